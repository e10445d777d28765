"""Check of a channel: a real notice that says that it is a test, and its outcome in plain words."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from dataclasses import dataclass

from PIL import Image, ImageDraw

from rosbot_patrol.alerts.channels.channel import Channel, DeliveryError, FailureCause
from rosbot_patrol.alerts.outbox.notice import Notice

_ADVICE = {
    FailureCause.UNKNOWN_HOST: (
        "Look at the host's name in the configuration, and whether this machine has a network and a name server."
    ),
    FailureCause.CONNECTION_REFUSED: "Look at host and port, and whether the server runs.",
    FailureCause.CERTIFICATE: "Look at the host's name, or name the certificate that signed the server's as ca_file.",
    FailureCause.NO_TLS: "Look at port and security: tls is usual on 465, starttls on 587 and 25.",
    FailureCause.NO_STARTTLS: (
        "The server offers no encryption on this port: try security: tls with port 465, or another server."
    ),
    FailureCause.LOGIN: "Look at user and password; many providers want a password for applications.",
    FailureCause.NO_ANSWER: (
        "A firewall or a wrong port keeps silent like this; providers often block port 25, try 587."
    ),
    FailureCause.RECIPIENT: "Look at the recipient's address.",
    FailureCause.REDIRECT: "Name the address that the server redirects to.",
    FailureCause.UNAUTHORIZED: "The address wants a token, or another one: token_file.",
    FailureCause.FORBIDDEN: "The server does not take the signature or the token: look at secret_file and token_file.",
    FailureCause.NOT_FOUND: "Look at the path of the url.",
}


@dataclass(frozen=True, kw_only=True)
class ChannelCheck:
    """Outcome of a test notice on one channel.

    Attributes:
        channel: name.
        text: the place of the notice, or why it was not taken.
        seconds: duration of the attempt [s].
        cause: kind of failure; None if the notice was taken.
    """

    channel: str
    text: str
    seconds: float
    cause: FailureCause | None = None

    @property
    def is_taken(self) -> bool:
        """Whether the channel took the notice."""
        return self.cause is None

    @property
    def advice(self) -> str:
        """What to look at, "" if there is nothing to say."""
        return _ADVICE.get(self.cause, "") if self.cause else ""


def try_channel(channel: Channel, notice: Notice, clock: Callable[[], float] = time.monotonic) -> ChannelCheck:
    """Send a notice through a channel, past the outbox."""
    began = clock()
    try:
        where = channel.transport.send(notice)
    except DeliveryError as err:
        return ChannelCheck(channel=channel.name, text=str(err), seconds=clock() - began, cause=err.cause)
    return ChannelCheck(channel=channel.name, text=where, seconds=clock() - began)


def make_test_notice(wall: float, host: str) -> Notice:
    """A notice that says that it is a test."""
    stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(wall))
    return Notice(
        id=f"{stamp}-test{int(wall * 1000) % 1000:03d}",
        wall=wall,
        kind="test",
        subject="rosbot patrol: a test",
        text=f"This is a test from the robot on {host}. Nothing happened.\n\nA notice about an intruder would come by"
        " the same way, with the camera's picture in the place of this one.",
        facts=(
            ("Time", time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(wall))),
            ("Letters", "Küche, salón, кухня, 台所, 🚪: do they look right?"),
        ),
        picture=_picture(),
        picture_name="test.jpg",
    )


def _picture() -> bytes:
    image = Image.new("RGB", (480, 270), (36, 86, 107))
    draw = ImageDraw.Draw(image)
    for i in range(16):
        draw.rectangle((i * 30, 200, i * 30 + 29, 269), fill=(16 * i, 120, 255 - 16 * i))
    draw.text((150, 90), "rosbot patrol: a test picture", fill=(255, 255, 255))
    out = io.BytesIO()
    image.save(out, "JPEG", quality=85)
    return out.getvalue()
