"""Depth pictures between rospy's thread, which keeps them, and the step that takes them; without a master."""

from __future__ import annotations

import sys
import threading
import time

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

import rospy
from sensor_msgs.msg import Image

from rosbot_patrol.patrol.senses.depth import KEPT
from rosbot_patrol.patrol.senses.records import ImageRecord, LensRecord
from rosbot_patrol.ros.patrol import sight_topics
from rosbot_patrol.ros.patrol.sight_topics import DepthTopic

COUNT = 400  # pictures


class Subscriber:
    """Stands in for rospy's: `send` calls the callback, as rospy's thread does."""

    open: list[Subscriber] = []

    def __init__(self, name, kind, callback, **_):
        del name, kind
        self.send, self.publishers = callback, 1
        Subscriber.open.append(self)

    def get_num_connections(self) -> int:
        return self.publishers

    def unregister(self) -> None:
        Subscriber.open.remove(self)


class Ring:
    """Writes down what it hears."""

    def __init__(self) -> None:
        self.is_on = False
        self.stamps: list[float] = []

    def hear(self, record: ImageRecord) -> None:
        self.stamps.append(record.stamp)

    def hear_lens(self, record: LensRecord) -> None:
        raise AssertionError("there is no lens")


def picture(number: int) -> Image:
    message = Image(encoding="16UC1", width=4, height=2, step=8, data=np.zeros((2, 4), np.uint16).tobytes())
    message.header.stamp = rospy.Time(number)
    return message


@pytest.fixture
def ring(monkeypatch: pytest.MonkeyPatch) -> Ring:
    monkeypatch.setattr(sight_topics.rospy, "Subscriber", Subscriber)
    Subscriber.open = []
    return Ring()


def test_it_listens_while_the_ring_wants_it(ring: Ring) -> None:
    topic = DepthTopic("/depth", "", ring)
    topic.follow()
    assert not topic.has_publisher
    assert Subscriber.open == []
    ring.is_on = True
    topic.follow()
    topic.follow()
    (subscriber,) = Subscriber.open
    assert topic.has_publisher
    subscriber.publishers = 0
    assert not topic.has_publisher
    subscriber.send(picture(1))
    ring.is_on = False
    topic.follow()
    assert Subscriber.open == []
    subscriber.send(picture(2))  # it was on its way
    ring.is_on = True
    topic.follow()
    topic.deliver()
    assert ring.stamps == []


def test_pictures_that_come_while_a_step_takes_them_are_heard_once_and_in_order(ring: Ring) -> None:
    topic, before, over = DepthTopic("/depth", "", ring), sys.getswitchinterval(), threading.Event()
    ring.is_on = True
    topic.follow()
    (subscriber,) = Subscriber.open
    until = time.monotonic() + 20.0

    def publish() -> None:
        for number in range(COUNT):
            while number - len(ring.stamps) >= KEPT:  # one more would push the oldest out
                if time.monotonic() > until:
                    return
            subscriber.send(picture(number))
        over.set()

    thread = threading.Thread(target=publish)
    sys.setswitchinterval(1e-5)
    try:
        thread.start()
        while thread.is_alive():
            topic.deliver()
    finally:
        thread.join()
        sys.setswitchinterval(before)
    topic.deliver()
    assert over.is_set()
    assert ring.stamps == [float(number) for number in range(COUNT)]
