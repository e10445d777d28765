"""The LDS-01's stream: turns, spoilt packets, garbage."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.drivers.lds.lds01 import TurnReader, encode

ROOM = np.round(1.0 + 0.5 * np.sin(np.radians(np.arange(360.0))), 3)
ROOM[10:20] = np.inf
TURN = encode(ROOM)


@given(st.lists(st.integers(0, 3 * 2520), max_size=8), st.binary(max_size=40))
def test_turns_come_whole_however_the_stream_is_cut(cuts: list[int], noise: bytes) -> None:
    data = noise.replace(b"\xfa\xa0", b"") + 3 * TURN
    marks = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    reader = TurnReader()
    turns = [turn for a, b in itertools.pairwise(marks) for turn in reader.feed(data[a:b])]
    assert len(turns) == 3
    for turn in turns:
        np.testing.assert_allclose(turn.ranges, ROOM)
        assert turn.speed == pytest.approx(5.0)


def test_a_spoilt_packet_is_unknown_and_the_rest_stays() -> None:
    spoilt = bytearray(TURN)
    spoilt[42 * 7] = 0
    (turn,) = TurnReader().feed(bytes(spoilt))
    assert np.isnan(turn.ranges).sum() == 6
    known = ~np.isnan(turn.ranges)
    np.testing.assert_allclose(turn.ranges[known], ROOM[known])


@given(st.lists(st.binary(max_size=300), max_size=30))
def test_garbage_is_survived_and_the_next_turn_is_found(pieces: list[bytes]) -> None:
    reader = TurnReader()
    for piece in pieces:
        reader.feed(piece)
    assert any(np.array_equal(turn.ranges, ROOM) for turn in reader.feed(3 * TURN))
