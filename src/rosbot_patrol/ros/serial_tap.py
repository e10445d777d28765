"""What devices send, byte for byte, on `~bytes`, for bags: `replay --node serial_node` takes it in again."""

from __future__ import annotations

import rospy

from rosbot_patrol.msg import SerialBytes
from rosbot_patrol.rosserial.client import Client


class SerialTap:
    """A Tap that publishes."""

    def __init__(self) -> None:
        self._publisher = rospy.Publisher("~bytes", SerialBytes, queue_size=1000)

    def opened(self, client: Client) -> None:
        """A connection began."""
        self._send(SerialBytes.OPENED, client, b"")

    def data(self, client: Client, data: bytes) -> None:
        """Bytes came."""
        self._send(SerialBytes.DATA, client, data)

    def closed(self, client: Client) -> None:
        """It ended."""
        self._send(SerialBytes.CLOSED, client, b"")

    def _send(self, event: int, client: Client, data: bytes) -> None:
        message = SerialBytes(event=event, peer=client.peer, address=client.address, data=data)
        message.header.stamp = rospy.Time.now()
        self._publisher.publish(message)
