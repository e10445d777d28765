"""Pictures drawn for as long as somebody learns them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from training.learning import stream
from training.learning.dataset import Pictures

WORLDS = Path(__file__).parents[2] / "worlds"


def test_a_round_has_all_kinds_in_an_order_of_its_own() -> None:
    rounds = [[stream.kind_of(42 * r + k, 5) for k in range(42)] for r in range(2)]
    for one in rounds:
        assert Counter(kind.house for kind in one) == {"": 30, "house": 4, "office": 4, "flat": 4}
        assert sum("cases" in kind.told for kind in one) == 16
    assert rounds[0] != rounds[1]
    assert rounds[0] == [stream.kind_of(k, 5) for k in range(42)]


def test_a_shard_depends_on_its_number_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "PER_SHARD", 2)
    monkeypatch.setattr(stream.os, "nice", lambda step: step)
    for name, first, step in (("one", 0, 1), ("other", 1, 2)):
        (tmp_path / name).mkdir()
        stream.draw(tmp_path / name, WORLDS, 5, first, step, last=2)
    one, other = (Pictures.open(tmp_path / name, "stream") for name in ("one", "other"))
    assert (len(one), len(other)) == (4, 2)
    assert np.array_equal(one.picture(1, 0), other.picture(0, 0))
    assert one.view(0, 0) is not None
    assert not list(tmp_path.glob("*/*.part*"))


def test_it_waits_while_nobody_takes_what_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "PER_SHARD", 1)
    monkeypatch.setattr(stream, "WAITING", 0)
    monkeypatch.setattr(stream.os, "nice", lambda step: step)
    waits: list[float] = []

    def take(seconds: float) -> None:
        waits.append(seconds)
        for file in tmp_path.glob("stream-*"):
            file.unlink()

    monkeypatch.setattr(stream, "sleep", take)
    stream.draw(tmp_path, WORLDS, 5, 0, 1, last=3)
    assert len(waits) == 2
