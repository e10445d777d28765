"""Two threads that connect to one publisher at the same time make one connection."""

import threading
import time
from collections import Counter

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rospy.impl.masterslave import ROSHandler

from rosbot_patrol.ros.runtime import connections


class Links:
    """A subscriber as rospy has it: looks whether it is connected, asks the publisher, then connects."""

    def __init__(self):
        self.made = []
        self.at_once = Counter()
        self.most = Counter()

    def connect(self, _handler, topic, publisher):
        link = topic, publisher
        self.at_once[link] += 1
        self.most[link] = max(self.most[link], self.at_once[link])
        is_connected = link in self.made
        time.sleep(0.05)  # the publisher answers
        if not is_connected:
            self.made.append(link)
        self.at_once[link] -= 1
        return 1, "", 0


@pytest.fixture
def links(monkeypatch):
    found = Links()
    monkeypatch.setattr(connections, "_connect", found.connect)
    monkeypatch.setattr(ROSHandler, "_connect_topic", ROSHandler._connect_topic)
    connections.install()
    return found


def connect_all(*wanted):
    threads = [threading.Thread(target=ROSHandler._connect_topic, args=(None, *link)) for link in wanted]
    start = time.monotonic()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return time.monotonic() - start


def test_five_announcements_of_one_publisher_make_one_connection(links):
    connect_all(*[("/tf", "http://a:1/")] * 5)
    assert links.made == [("/tf", "http://a:1/")]
    assert links.most[("/tf", "http://a:1/")] == 1


def test_other_topics_and_publishers_do_not_wait(links):
    wanted = [("/tf", "http://a:1/"), ("/tf", "http://b:1/"), ("/scan", "http://a:1/")] * 2
    connect_all(*wanted)
    assert sorted(links.made) == sorted(set(wanted))


def test_a_publisher_that_cannot_be_asked_leaves_no_lock(links, monkeypatch):
    def fail(*_):
        raise OSError("refused")

    monkeypatch.setattr(connections, "_connect", fail)
    with pytest.raises(OSError, match="refused"):
        ROSHandler._connect_topic(None, "/tf", "http://a:1/")
    monkeypatch.setattr(connections, "_connect", links.connect)
    connect_all(("/tf", "http://a:1/"))
    assert links.made == [("/tf", "http://a:1/")]


def test_without_the_guard_there_are_several(links, monkeypatch):
    monkeypatch.setattr(ROSHandler, "_connect_topic", links.connect)
    connect_all(*[("/tf", "http://a:1/")] * 5)
    assert len(links.made) > 1
