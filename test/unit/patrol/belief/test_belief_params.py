"""The table of parameters stays small."""

from __future__ import annotations

import dataclasses

from rosbot_patrol.patrol.belief.params import BeliefParams


def test_at_most_25_parameters() -> None:
    assert len(dataclasses.fields(BeliefParams)) <= 25
