"""What a poor link does to frames, without sockets."""

from __future__ import annotations

import itertools
import math

import pytest

from rosbot_patrol.rosserial.device.poor_link import PERFECT, LinkQuality, PoorLink


def frames(count: int) -> list[bytes]:
    return [bytes([i % 256, i // 256]) for i in range(count)]


def test_a_perfect_link_hands_each_frame_on_at_once() -> None:
    link = PoorLink(PERFECT, 0.0)
    link.put(b"a", 1.0)
    assert link.take(1.0) == [b"a"]
    assert link.next_event == math.inf
    assert not link.breaks(1e9)


def test_frames_come_late_and_in_order() -> None:
    link = PoorLink(LinkQuality(delay=1.0, jitter=2.0, seed=3), 0.0)
    sent = frames(300)
    arrived: list[tuple[float, bytes]] = []
    for i in range(3000):
        now = 0.1 * i
        if i < len(sent):
            link.put(sent[i], now)
        arrived += [(now, frame) for frame in link.take(now)]
    assert [frame for _, frame in arrived] == sent
    late = [at - 0.1 * i for i, (at, _) in enumerate(arrived)]
    assert min(late) >= 1.0 - 1e-9
    assert max(late) <= 3.1 + 1e-9


def test_a_part_of_them_is_lost_the_same_with_the_same_seed() -> None:
    def kept(seed: int) -> list[bytes]:
        link = PoorLink(LinkQuality(loss=0.3, seed=seed), 0.0)
        for frame in frames(2000):
            link.put(frame, 0.0)
        return link.take(0.0)

    assert len(kept(1)) == pytest.approx(1400, abs=70)
    assert kept(1) == kept(1)
    assert kept(1) != kept(2)


def test_it_breaks_at_random_and_loses_what_was_on_its_way() -> None:
    link = PoorLink(LinkQuality(delay=0.05, drop_every=10.0, seed=5), 0.0)
    breaks = []
    for i in range(200_000):
        now = 0.05 * i
        link.put(b"x", now)
        if link.breaks(now):
            breaks.append(now)
            assert link.take(now + 1.0) == []
        link.take(now)
    gaps = [b - a for a, b in itertools.pairwise(breaks)]
    assert sum(gaps) / len(gaps) == pytest.approx(10.0, rel=0.15)
    assert min(gaps) < 3.0 < 20.0 < max(gaps)
