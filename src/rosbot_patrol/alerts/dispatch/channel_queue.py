"""One channel's queue: what leaves when. Order is kept, nothing is dropped.

- A channel that is down is tried ever more rarely, with jitter, up to a quarter of an hour; all wait for the oldest.
- A notice that the channel refuses for good lets the others pass and is tried again rarely. So does one that the
  channel did not want "now" several times, once the channel takes the next one.
- Between two messages lies `interval`. Notices that are not urgent gather meanwhile and leave as one digest.
- An urgent notice (an intruder) is never merged. It waits only for the interval after the urgent one before it; what
  stands in front of it leaves at once.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rosbot_patrol.alerts.channels.channel import DeliveryError, Pace
from rosbot_patrol.alerts.outbox.outbox import Waiting

DIGEST_FROM = 3  # fewer notices than this leave one by one
DIGEST_MOST = 500  # notices of one digest
DOUBTFUL = 6  # times that a server did not want a notice "now" until the notice may be at fault
RARELY = (900.0, 21600.0)  # first and longest pause for a notice that was refused [s]


@dataclass
class _Refusal:
    times: int = 0
    due: float = 0.0
    error: str = ""
    is_final: bool = False  # the other side said so; otherwise it is our guess


class ChannelQueue:
    """The notices that one channel has still to take.

    Args:
        pace: intervals and delays.
        rng: of the jitter.
        last: time of the channel's last message before the program began [s].
    """

    def __init__(self, pace: Pace, rng: random.Random, *, last: float = float("-inf")) -> None:
        self._pace, self._rng = pace, rng
        self._queue: list[Waiting] = []
        self._refused: dict[str, _Refusal] = {}
        self._alone: set[str] = set()
        self._unwanted: dict[str, int] = {}
        self._last = self._last_urgent = last
        self._failures = 0
        self._blocked_until = self._last_try = float("-inf")
        self._asked_until = float("-inf")  # the other side asked for a pause until then
        self.down_since: float | None = None
        self.error = ""

    def __len__(self) -> int:
        return len(self._queue)

    @property
    def oldest(self) -> Waiting | None:
        """The first notice that waits."""
        return self._queue[0] if self._queue else None

    @property
    def refused(self) -> list[tuple[Waiting, str]]:
        """Notices that the channel refused for good, each with its words."""
        return [(entry, self._refused[entry.id].error) for entry in self._queue if entry.id in self._refused]

    @property
    def refused_for_good(self) -> list[tuple[Waiting, str]]:
        """Those of `refused` that the other side called final; it did not want the others "now" too often."""
        return [(entry, error) for entry, error in self.refused if self._refused[entry.id].is_final]

    def offer(self, waiting: Iterable[Waiting]) -> None:
        """Set what the channel has to take now, oldest first."""
        self._queue = list(waiting)
        ids = {entry.id for entry in self._queue}
        self._refused = {name: state for name, state in self._refused.items() if name in ids}
        self._alone &= ids
        self._unwanted = {name: times for name, times in self._unwanted.items() if name in ids}

    def due(self, now: float) -> list[Waiting]:
        """The notices to send now as one message: none, one, or several for a digest."""
        if now < self._blocked_until:
            return []
        open_ = [e for e in self._queue if e.id not in self._refused or self._refused[e.id].due <= now]
        if not open_:
            return []
        if len(open_) > 1 and self._is_doubtful(open_[0]) and self._failures % 2:
            return open_[1:2]  # to see whether the channel takes any
        may_urgent = now >= self._last_urgent + self._pace.interval
        if open_[0].is_urgent:
            return open_[:1] if may_urgent else []
        hurry = may_urgent and any(entry.is_urgent for entry in open_)
        if now < self._last + self._pace.interval and not hurry:
            return []
        return self._together(open_)

    def wait(self, now: float) -> float | None:
        """Time until `due` may give something [s]; None if nothing waits."""
        if not self._queue:
            return None
        refused = self._refused
        first = min(refused[e.id].due if e.id in refused else float("-inf") for e in self._queue)
        urgent = any(entry.is_urgent and entry.id not in refused for entry in self._queue)
        gate = (self._last_urgent if urgent else self._last) + self._pace.interval
        return max(max(first, self._blocked_until, gate) - now, 0.0)

    def delivered(self, batch: Sequence[Waiting], now: float) -> None:
        """Note that a message was taken."""
        for entry in self._queue:
            if entry.id == batch[0].id:
                break
            if self._is_doubtful(entry):  # the channel took a younger one: try this one once more, then rarely
                self._refused.setdefault(entry.id, _Refusal(due=now, error=self.error))
        ids = {entry.id for entry in batch}
        self._queue = [entry for entry in self._queue if entry.id not in ids]
        for name in ids:
            self._refused.pop(name, None)
        self._last = now
        if any(entry.is_urgent for entry in batch):
            self._last_urgent = now
        self._is_up()

    def failed(self, batch: Sequence[Waiting], now: float, err: DeliveryError) -> float:
        """Note that a message was not taken.

        Args:
            batch: the notices of the message.
            now: time [s].
            err: why it was not taken.

        Returns:
            Time until the next attempt [s].
        """
        self._last_try = now
        self.error = str(err)
        is_refused = err.permanent
        if err.answered:
            for entry in batch:
                self._unwanted[entry.id] = self._unwanted.get(entry.id, 0) + 1
            is_refused = is_refused or any(entry.id in self._refused for entry in batch)
        if not is_refused:
            return self._back_off(now, err.delay)
        self._is_up(str(err))
        if err.of_recipient:
            # A digest is not taken apart, and the next message waits: servers lock out a peer that asks for unknown
            # users again and again.
            self._blocked_until = now + self._pace.interval
            return max(self._refuse([entry], now, err) for entry in batch)
        return self._refuse(batch, now, err)

    def _back_off(self, now: float, asked: float | None) -> float:
        """Try nothing for a while that doubles each time; at least as long as the other side `asked` for [s]."""
        self._failures += 1
        if self.down_since is None:
            self.down_since = now
        put_off = self._jittered(self._pace.first_delay * 2.0 ** min(self._failures - 1, 30))
        if asked is not None:
            put_off = max(put_off, min(asked, self._pace.max_delay))
            self._asked_until = now + min(asked, self._pace.max_delay)
        self._blocked_until = now + put_off
        return put_off

    def nudge(self, now: float, *, all_: bool = False) -> None:
        """Try again soon: there is a new notice, or the network came back.

        Args:
            now: time [s].
            all_: try refused notices too, and respect no pause, not even one that the other side asked for.
        """
        soonest = now if all_ else max(now, self._last_try + self._pace.first_delay, self._asked_until)
        self._blocked_until = min(self._blocked_until, soonest)
        if all_:
            for state in self._refused.values():
                state.due = now

    def _together(self, open_: Sequence[Waiting]) -> list[Waiting]:
        run: list[Waiting] = []
        for entry in open_:
            if entry.is_urgent or entry.id in self._alone:
                break
            run.append(entry)
        return run[:DIGEST_MOST] if len(run) >= DIGEST_FROM else list(open_[:1])

    def _is_doubtful(self, entry: Waiting) -> bool:
        return self._unwanted.get(entry.id, 0) >= DOUBTFUL and entry.id not in self._refused

    def _refuse(self, batch: Sequence[Waiting], now: float, err: DeliveryError) -> float:
        if len(batch) > 1:  # one of them is at fault: try each by itself
            self._alone |= {entry.id for entry in batch}
            return 0.0
        state = self._refused.setdefault(batch[0].id, _Refusal())
        state.times += 1
        state.error, state.is_final = str(err), err.permanent
        put_off = min(RARELY[0] * 2.0 ** min(state.times - 1, 20), RARELY[1])
        state.due = now + put_off
        return put_off

    def _is_up(self, error: str = "") -> None:
        self._failures, self._blocked_until, self._asked_until = 0, float("-inf"), float("-inf")
        self.down_since, self.error = None, error

    def _jittered(self, delay: float) -> float:
        shift = 1.0 + self._pace.jitter * (2.0 * self._rng.random() - 1.0)
        return min(delay * shift, self._pace.max_delay)
