"""For tests of the post: a clock that the test moves, and channels that fail as told."""

from pathlib import Path

from rosbot_patrol.alerts.channels.channel import Channel, DeliveryError, Pace
from rosbot_patrol.alerts.dispatch.delivery import Clocks
from rosbot_patrol.alerts.dispatch.dispatcher import Dispatcher
from rosbot_patrol.alerts.dispatch.spare_post import SparePost
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.alerts.outbox.receipts import Receipts


class Time:
    """Seconds since 1970, and those of the machine."""

    def __init__(self, now=1000.0, wall=1_790_000_000.0):
        self.now, self._offset = now, wall - now

    @property
    def wall(self):
        return self.now + self._offset

    @property
    def clocks(self):
        return Clocks(now=lambda: self.now, wall=lambda: self.wall)


class Box:
    """A channel's other end: `down` is what it says instead of taking a notice."""

    name = "box"

    def __init__(self, time=None):
        self.taken, self.down, self.permanent, self.tries, self._time = [], "", False, 0, time

    def describe(self):
        return "a box"

    def send(self, notice):
        self.tries += 1
        if self.down and self._time:
            self._time.now += 30.0  # a time-out
        if self.down:
            raise DeliveryError(self.down, permanent=self.permanent)
        self.taken.append(notice)
        return "in the box"

    @property
    def ids(self):
        return [notice.id for notice in self.taken]


def notice(name, kind="incident", **given):
    return Notice(
        **{"id": name, "wall": 1_790_000_000.0, "kind": kind, "subject": f"about {name}", "text": "t", **given}
    )


def channel(name, transport, *, kinds=(), interval=0.0, first_delay=5.0):
    pace = Pace(interval=interval, first_delay=first_delay)
    return Channel(name=name, transport=transport, kinds=kinds, pace=pace)


def dispatcher(folder: Path, *channels, time=None, **given):
    time = time or Time()
    return Dispatcher(Outbox(folder), channels, clocks=time.clocks, seed=1, who="test", **given)


def deliver_all(post, *, look=True):
    """Whatever is due on any channel."""
    done = []
    if look:
        post.refresh()
    for name in post.channels:
        while (delivery := post.deliver(name)) is not None:
            done.append(delivery)
    return done


def spare(*channels, time=None):
    return SparePost(channels, clocks=(time or Time()).clocks, seed=1)


def send_all(post, *names):
    """Whatever is due on these channels of a spare post."""
    done = []
    for name in names:
        while (delivery := post.deliver(name)) is not None:
            done.append(delivery)
    return done


def settle(post, folder):
    """Hand what a spare post holds to the outbox on disk."""
    box = Outbox(folder)
    box.make()
    return post.settle(box, Receipts(folder / "taken.jsonl"))
