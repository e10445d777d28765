#!/usr/bin/env python3
"""Error rates of the sightings: false alarms in an empty house, and people missed, over full turns at random places.

    benchmarks/watch.py [--world FILE] [--turns N] [--weights FILE] [--json FILE]

The robot is put at N places of the house and turns once, with a picture every 3 degrees, as at 10 Hz. Each picture goes
through jpeg, the network and the sightings, exactly as in the nodes, but without ROS and as fast as possible. Every
turn is made twice: with nobody, and with a person (with a look or posture that training never drew) 1 to 6 m away.
Several settings are judged on the same boxes; the first is the one in config/tuned/watch.yaml.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import dataclasses
import json
import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import yaml

from rosbot_patrol.detection.detector import DarknetDetector, load_detector
from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.params import load
from rosbot_patrol.patrol.intruder.sightings import Sightings, SightingsParams
from rosbot_patrol.patrol.records.inputs import Box, Frame
from rosbot_patrol.simulation.engine import Engine, EngineParams
from rosbot_patrol.simulation.render.egl import make_renderer
from rosbot_patrol.simulation.robot.description import load_robot
from rosbot_patrol.simulation.sdf.world import World, load_world

ROOT = Path(__file__).resolve().parent.parent
CLASSES = ("person", "fire hydrant")
LOOKS = ("intruder_test_balaclava", "intruder_test_violet", "intruder_test_orchid")
STEP_DEG = 3.0
PERIOD = 0.1


def make_engine(world: World) -> Engine:
    """Make the world with the ROSbot at the origin."""
    engine = Engine(world, EngineParams(seed=1), make_renderer=lambda: make_renderer("egl"))
    engine.spawn_robot(load_robot(ROOT / "urdf" / "rosbot.urdf"))
    return engine


def is_inside(engine: Engine, place: Pose2D) -> bool:
    """Whether a robot can stand and turn there, with walls around it."""
    try:
        engine.carry(place)
    except WorldError:
        return False
    ranges = engine.scan().ranges
    return bool(ranges.min() > 0.35 and np.isfinite(ranges).mean() > 0.9)


def draw_places(engine: Engine, rng: np.random.Generator, count: int) -> Iterator[Pose2D]:
    """Draw random places."""
    segments = engine.ways.cut(engine.robot.lidar_height).segments.reshape(-1, 2)
    low, high = segments.min(axis=0), segments.max(axis=0)
    while count:
        x, y = rng.uniform(low, high)
        place = Pose2D(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))
        if is_inside(engine, place):
            count -= 1
            yield place


def place_person(engine: Engine, place: Pose2D, rng: np.random.Generator, looks: list[str]) -> bool:
    """Place a person visible to the robot there; False if no place was found."""
    engine.carry(place)
    level = engine.level_scan()
    scan = level.scan
    for _ in range(40):
        beam = int(rng.integers(len(scan.ranges)))
        far = min(float(scan.ranges[beam]), 6.5) - 0.5
        if far < 1.0:
            continue
        reach = float(rng.uniform(1.0, far))
        bearing = place.yaw + level.pose.yaw + scan.angle_min + beam * scan.angle_increment
        spot = Pose2D(place.x + reach * math.cos(bearing), place.y + reach * math.sin(bearing), rng.uniform(-3, 3))
        near = scan.ranges[np.arange(beam - 8, beam + 9) % len(scan.ranges)]
        if near.min() < reach + 0.3:
            continue
        posture = str(rng.choice(["", "", "creeping", "sitting", "crouching"]))
        try:
            engine.population.spawn_actor("person_there", "person", str(rng.choice(looks)), spot, posture=posture)
        except WorldError:
            continue
        return True
    return False


def turn(engine: Engine, detector: DarknetDetector, place: Pose2D) -> list[Frame]:
    """Boxes of a full turn, with the first half metre of arc repeated."""
    frames = []
    for i in range(round(360.0 / STEP_DEG) + 6):
        engine.carry(Pose2D(place.x, place.y, place.yaw + math.radians(i * STEP_DEG)))
        engine.step()
        colour = engine.picture(depth=False).colour
        coded = cv2.imencode(".jpg", colour[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 80])[1]
        seen = np.ascontiguousarray(cv2.imdecode(coded, cv2.IMREAD_COLOR)[:, :, ::-1])
        boxes = tuple(
            Box(label=d.name, probability=d.probability, xmin=d.xmin, ymin=d.ymin, xmax=d.xmax, ymax=d.ymax)
            for d in detector.detect(Picture(seen, "rgb8"))
        )
        frames.append(Frame(stamp=(i + 1) * PERIOD, boxes=boxes))
    return frames


def judge(params: SightingsParams, frames: list[Frame]) -> str:
    """Class that the sightings confirm on those pictures, "" for none."""
    watch = Sightings(CLASSES, params)
    watch.start(0.0)
    for frame in frames:
        assert frame.stamp is not None
        found = watch.add(frame.stamp, frame)
        if found:
            return found[0].label
    return ""


def settings(weights_free: SightingsParams) -> dict[str, SightingsParams]:
    """The shipped setting, and alternatives."""
    others = [(3, 5, 0.5), (3, 5, 0.65), (4, 6, 0.7), (5, 6, 0.7), (5, 6, 0.8)]
    named = {f"shipped: {weights_free.frames} of {weights_free.window} at {weights_free.min_score}": weights_free}
    for frames, window, score in others:
        changed = dataclasses.replace(weights_free, frames=frames, window=window, min_score=score)
        named[f"{frames} of {window} at {score}"] = changed
    return named


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", default=str(ROOT / "worlds" / "house.world"))
    parser.add_argument("--turns", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threshold", type=float, default=0.4, help="the detector's, as models/house.yaml")
    parser.add_argument("--cfg", default=str(ROOT / "models" / "house.cfg"))
    parser.add_argument("--weights", default=str(ROOT / "models" / "house.weights"))
    parser.add_argument("--looks", default=",".join(LOOKS), help="of the persons")
    parser.add_argument("--pictures", type=Path, help="folder for a picture of each false alarm")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    tuned = yaml.safe_load((ROOT / "config" / "tuned" / "watch.yaml").read_text(encoding="utf-8"))["watch"]
    chosen = settings(load(SightingsParams, tuned))
    detector = load_detector(arguments.cfg, arguments.weights, list(CLASSES), threshold=arguments.threshold)
    engine = make_engine(load_world(arguments.world))
    looks = arguments.looks.split(",")
    false = dict.fromkeys(chosen, 0)
    found = dict.fromkeys(chosen, 0)
    turns = persons = pictures = boxes = 0
    for place in draw_places(engine, rng, arguments.turns):
        frames = turn(engine, detector, place)
        turns += 1
        pictures += len(frames)
        boxes += sum(len(f.boxes) for f in frames)
        for name, params in chosen.items():
            false[name] += bool(judge(params, frames))
        if arguments.pictures and any(judge(p, frames) for p in chosen.values()):
            save(engine, place, frames, arguments.pictures)
        if place_person(engine, place, rng, looks):
            persons += 1
            frames = turn(engine, detector, place)
            for name, params in chosen.items():
                found[name] += judge(params, frames) == "person"
            engine.population.remove("person_there")
        sys.stderr.write(f"\r{turns} of {arguments.turns} places ")
    engine.close()
    in_workspace.require_figures(range(turns), "no place was looked from")
    print(f"\n{os.cpu_count()} cores; {turns} turns in the empty house, {pictures} pictures with {boxes} false boxes")
    print(f"\n| watch | false alarms, {turns} turns | persons found, {persons} turns |\n|---|---|---|")
    for name in chosen:
        print(f"| {name} | {false[name]} | {found[name]} |")
    first = next(iter(chosen))
    figures = {
        "false_alarms_per_turn": false[first] / max(turns, 1),
        "persons_found": found[first] / max(persons, 1),
        "false_boxes_per_picture": boxes / max(pictures, 1),
    }
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def save(engine: Engine, place: Pose2D, frames: list[Frame], folder: Path) -> None:
    """Save the picture with the most probable false box of a turn."""
    i = max(range(len(frames)), key=lambda k: max((b.probability for b in frames[k].boxes), default=0.0))
    engine.carry(Pose2D(place.x, place.y, place.yaw + math.radians(i * STEP_DEG)))
    colour = engine.picture(depth=False).colour[:, :, ::-1].copy()
    for box in frames[i].boxes:
        cv2.rectangle(colour, (box.xmin, box.ymin), (box.xmax, box.ymax), (0, 0, 255), 2)
        text = f"{box.label} {box.probability:.2f}"
        cv2.putText(colour, text, (box.xmin, max(box.ymin - 4, 12)), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 255), 1)
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / f"{place.x:.2f}_{place.y:.2f}.jpg"), colour)


if __name__ == "__main__":
    main()
