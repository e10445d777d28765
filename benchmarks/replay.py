#!/usr/bin/env python3
"""Bags replayed offline on one core: speed relative to their recording.

    PYTHONPATH=src .ws/venv/bin/python benchmarks/replay.py [--json FILE] [--quick] [--bag FILE --map YAML]

The bag is a drive through three rooms of the house (mapping_house.py): 720 beams at 10 Hz, odometry on /tf at 50 Hz. It
is made once and kept in .ws. The patrol's bag is from its small test world: a minute of rest, a mission, a minute of
rest, with 25 tf messages and 8 answers of the detector a second and no scans, at the node's 25 steps a second. A replay
is everything from opening the bag to the finished result. A separate column has the preparation (the map's distances).
Medians of the repeats.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import logging
import os
import statistics
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "src"), *(str(ROOT / "test" / "unit" / name) for name in ("replay", "patrol"))]

import made_patrol  # noqa: E402
import mapping_house  # noqa: E402
from made_bag import Maker, write_bag  # noqa: E402

from rosbot_patrol.amcl.scan_model.likelihood_field import blocked_distances  # noqa: E402
from rosbot_patrol.geometry import Pose2D, compose, invert  # noqa: E402
from rosbot_patrol.patrol.house.rooms import load_rooms  # noqa: E402
from rosbot_patrol.replay.bags.bag import Bag  # noqa: E402
from rosbot_patrol.replay.bags.carmen import noisy_odometry  # noqa: E402
from rosbot_patrol.replay.nodes.setup import Setup, build_replay  # noqa: E402
from rosbot_patrol.replay.runner import run_replay  # noqa: E402

BEGIN = 1_600_000_000.0
TF_PER_SCAN = 5
AIMS = {"amcl_rtf": 200.0, "gmapping_rtf": 5.0, "patrol_rtf": 1000.0}


def messages() -> Iterator[tuple[float, str, Any]]:
    """The drive from the base through three rooms and back."""
    maker = Maker()
    rooms = [(room.pose.x, room.pose.y) for room in load_rooms(ROOT / "params" / "room_points.yaml")]
    poses = mapping_house.drive(mapping_house.waypoints([*rooms[:4], rooms[0]]))
    odometry = noisy_odometry(poses, np.random.default_rng(1))
    field = blocked_distances(mapping_house.plan(mapping_house.WORLD, mapping_house.BOUNDS, 0.02), 3.0)
    mount = mapping_house.MOUNT
    laser = maker.transform("base_link", "laser", BEGIN, (mount.x, mount.y, 0.1), (0.0, 0.0, 1.0, 0.0))
    yield BEGIN, "/tf_static", maker.tf(laser)
    period = 1.0 / mapping_house.RATE
    for i, scan in enumerate(mapping_house.scans(poses, field, np.random.default_rng(2))):
        stamp = BEGIN + scan.stamp
        yield stamp + 0.002, "/scan", maker.scan(type(scan)(**{**scan.__dict__, "stamp": stamp}))
        here, there = (Pose2D(*odometry[min(i + k, len(odometry) - 1)]) for k in (0, 1))
        move = compose(invert(here), there)
        for k in range(TF_PER_SCAN):
            share = k / TF_PER_SCAN
            pose = compose(here, Pose2D(move.x * share, move.y * share, move.yaw * share))
            when = stamp + share * period
            yield when + 0.003, "/tf", maker.tf(maker.planar("odom", "base_link", when, pose))


def patrol_messages() -> list[tuple[float, str, Any]]:
    """A mission to room 2 between two minutes of rest."""
    world = made_patrol.RecordedWorld()
    for _ in range(25 * 60):
        world.step()
    world.mission(2)
    for _ in range(25 * 60):
        world.step()
    return sorted(world.messages, key=lambda each: each[0])


def make_bag(path: Path, content: Iterable[tuple[float, str, Any]]) -> None:
    """Write a bag, whole or not at all."""
    part = path.with_suffix(".part")
    write_bag(part, content)
    part.replace(path)


def measure(bag: Path, setup: Setup, repeats: int) -> tuple[float, float, float]:
    """Duration of the bag, of building, and of the replay [s]."""
    built, spent, duration = [], [], 0.0
    for _ in range(repeats):
        begin = time.perf_counter()
        replay = build_replay(setup)
        built.append(time.perf_counter() - begin)
        begin = time.perf_counter()
        with Bag(bag) as opened:
            duration = opened.duration
            run_replay(opened, replay)
        spent.append(time.perf_counter() - begin)
    return duration, statistics.median(built), statistics.median(spent)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--quick", action="store_true", help="one run each")
    parser.add_argument("--bag", type=Path, default=ROOT / ".ws" / "replay_benchmark.bag", help="another bag")
    parser.add_argument("--map", type=Path, default=ROOT / "maps" / "rosbot_map.yaml", metavar="YAML")
    options = parser.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    print(f"1 core of {os.cpu_count()}")
    if not options.bag.exists():
        make_bag(options.bag, messages())
    patrol, points = options.bag.with_suffix(".patrol.bag"), options.bag.with_suffix(".rooms.yaml")
    if not patrol.exists():
        make_bag(patrol, patrol_messages())
        points.write_text(made_patrol.POINTS, encoding="utf-8")
    logging.disable(logging.WARNING)
    figures: dict[str, float] = {}
    print(f"{'figure':14s} {'found':>8s} {'aim':>8s} {'bag s':>8s} {'build s':>8s} {'replay s':>9s}")
    for name, bag, setup, repeats in (
        ("amcl_rtf", options.bag, Setup(node="amcl", map=options.map), 5),
        ("gmapping_rtf", options.bag, Setup(node="slam_gmapping"), 2),
        ("patrol_rtf", patrol, Setup(node="patrol_robot", tree={"look_around": "spin"}, rooms=points), 5),
    ):
        duration, build, spent = measure(bag, setup, 1 if options.quick else repeats)
        figures[name] = round(duration / spent, 1)
        aim = f">= {AIMS[name]:g}"
        print(f"{name:14s} {figures[name]:8.1f} {aim:>8s} {duration:8.1f} {build:8.2f} {spent:9.3f}")
    if options.json:
        options.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
