"""What is drawn to train on: the sets of all kinds, each with its share of the pictures and a seed of its own."""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections import Counter
from pathlib import Path

from training.pictures import render
from training.pictures.kinds import KINDS, MOST

WORLDS = Path(__file__).parents[2] / "worlds"


def jobs_of(pictures: int, seed: int) -> list:
    options = argparse.Namespace(
        folder=Path("data"), jpeg=True, set=None, kinds=True, pictures=pictures, seed=seed, worlds=WORLDS, detailed=0.0
    )
    return render._jobs_asked_for(options)


def test_each_kind_has_its_share_of_the_shards() -> None:
    counts = Counter(job.target.name.rsplit("-", 1)[0] for job in jobs_of(MOST * render.PER_SHARD, 7))
    assert counts == {kind.name(7): kind.parts for kind in KINDS}
    assert counts["vary_7"] == 20


def test_the_first_pictures_of_a_kind_stay_when_more_are_asked_for() -> None:
    few, many = (jobs_of(n, 3) for n in (1, 70000))
    assert len(few) == len(KINDS)
    assert set(map(repr, few)) < set(map(repr, many))


def test_no_two_kinds_of_a_room_have_a_seed_in_common() -> None:
    places = Counter((kind.house, kind.offset) for kind in KINDS)
    assert set(places.values()) == {1}


def test_the_houses_are_there() -> None:
    houses = {job.house for job in jobs_of(1, 1)} - {None}
    assert len(houses) == 3
    assert all(house.exists() for house in houses)


def test_the_command_names_the_sets_that_are_drawn() -> None:
    module = "training.pictures.kinds"
    told = subprocess.run([sys.executable, "-m", module, "12"], capture_output=True, text=True, check=True)
    assert told.stdout.strip().split(",") == [kind.name(12) for kind in KINDS]
