#!/usr/bin/env python3
"""Accuracy of a person's place on the map, and rejections: people, pets and posters in the houses.

    python3 benchmarks/person_place.py [--number N] [--network NAME --figures detailed] [--json FILE]

The robot is put at random places. A person, a pet or a poster 1 to 6.5 m away is photographed once, with depth and
scan, through the simulator's camera and a network, without ROS. Places are measured with depth and without
(lidar, else the floor). The pose in the map is the true one, so amcl's error is not included.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import json
import math
from collections import Counter
from pathlib import Path

import numpy as np
from places import LOOKS, draw_places, make_engine

from rosbot_patrol.detection.choice import open_network
from rosbot_patrol.detection.detector import Detector
from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, transform_points
from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.patrol.belief.likelihoods import possibility
from rosbot_patrol.patrol.belief.params import BeliefParams
from rosbot_patrol.patrol.house.floor import floor_of
from rosbot_patrol.patrol.intruder.lidar_motion import off_the_map
from rosbot_patrol.patrol.intruder.measure import Depth, Lens, View, measure
from rosbot_patrol.patrol.records.inputs import Box, Measured
from rosbot_patrol.simulation.scene.matrices import from_pose2d
from rosbot_patrol.simulation.sdf.world import load_world

ROOT = Path(__file__).resolve().parent.parent
HOUSES = {"house": "rosbot", "flat": "flat", "office": "office"}
KINDS = ("person", "dog", "cat", "poster")


class Stage:
    """One house with its robot, its map and a network."""

    def __init__(self, house: str, detector: Detector, figures: str) -> None:
        self.engine = make_engine(load_world(ROOT / "worlds" / f"{house}.world"), figures)
        self.floor = floor_of(read_map(ROOT / "maps" / f"{HOUSES[house]}_map.yaml"))
        k = self.engine.params.camera.intrinsics
        self.lens = Lens(fx=k.fx, fy=k.fy, cx=k.cx, cy=k.cy, width=k.width, height=k.height)
        self.detector = detector

    def view(self) -> View:
        """The camera's present viewpoint."""
        mount = self.engine.robot.description.camera
        assert mount is not None
        pose = from_pose2d(self.engine.pose, self.engine.robot.description.base_height) @ mount.pose
        return View(self.lens, np.asarray(pose, np.float64))

    def look(self) -> tuple[list[Box], Depth, np.ndarray]:
        """The detector's boxes, the depth, and the lidar's hits off the map."""
        self.engine.step()
        picture = self.engine.picture()
        boxes = [
            Box(label=d.name, probability=d.probability, xmin=d.xmin, ymin=d.ymin, xmax=d.xmax, ymax=d.ymax)
            for d in self.detector.detect(Picture(np.ascontiguousarray(picture.colour), "rgb8"))
        ]
        points = transform_points(self.engine.pose, self.engine.level_scan().points)
        off = off_the_map(self.floor, points, 0.3)
        return boxes, Depth(picture.depth, self.lens), off


def put(stage: Stage, kind: str, place: Pose2D, rng: np.random.Generator) -> Pose2D | None:
    """Put something into the camera's view; None if there is no room for it."""
    engine = stage.engine
    for _ in range(30):
        engine.carry(place)
        bearing = float(rng.uniform(-0.45, 0.45))
        level = engine.level_scan()
        scan, angles = level.scan, level.pose.yaw + level.scan.angles
        beam = int(np.abs((angles - bearing + math.pi) % math.tau - math.pi).argmin())
        wall = float(scan.ranges[beam])
        far = wall - 0.02 if kind == "poster" else float(rng.uniform(1.0, max(min(wall, 7.0) - 0.5, 1.1)))
        if not 1.0 <= far <= 6.5 or (kind != "poster" and far > wall - 0.4):
            continue
        x, y = place.x + far * math.cos(place.yaw + bearing), place.y + far * math.sin(place.yaw + bearing)
        turned = place.yaw + bearing + math.pi if kind == "poster" else float(rng.uniform(-3, 3))
        posture = str(rng.choice(["", "", "creeping", "sitting", "crouching"])) if kind == "person" else ""
        try:
            engine.population.spawn_actor(
                "it", kind, str(rng.choice(LOOKS)) if kind == "person" else "", Pose2D(x, y, turned), posture=posture
            )
        except WorldError:
            continue
        return Pose2D(x, y, turned)
    return None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--number", type=int, default=20, help="of places in each house for each kind")
    parser.add_argument("--network", default="house", help="that finds people, as network:= takes it")
    parser.add_argument("--figures", choices=("plain", "detailed"), default="plain", help="of people")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rng = np.random.default_rng(4)
    detector = open_network(arguments.network).detector
    errors: dict[str, list[float]] = {"depth": [], "lidar": [], "floor": []}
    told: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    for house in HOUSES:
        stage = Stage(house, detector, arguments.figures)
        for kind in KINDS:
            for place in draw_places(stage.engine, rng, arguments.number):
                there = put(stage, kind, place, rng)
                if there is None:
                    continue
                tell(stage, kind, there, errors=errors, told=told[kind])
                stage.engine.population.remove("it")
        stage.engine.close()
    report(errors, told, arguments.json)


def tell(
    stage: Stage,
    kind: str,
    there: Pose2D,
    *,
    errors: dict[str, list[float]],
    told: Counter[str],
) -> None:
    """Look, measure, and record."""
    boxes, depth, off = stage.look()
    view = stage.view()
    people = [box for box in boxes if box.label == "person" and box.probability > 0.6]
    told["looked at"] += 1
    if not people:
        told["no box"] += 1
        return
    best = max(people, key=lambda box: box.probability)
    with_depth, without = measure(best, view, depth, off), measure(best, view, None, off)
    found = possibility(with_depth, BeliefParams())
    refusal = found[1].value if found is not None and found[1] is not None else ""
    told[refusal or "taken for an intruder"] += 1
    if kind == "person":
        for m in (with_depth.measured, without.measured):
            if m is not None and not (m.source == "depth" and m is without.measured):
                errors[m.source].append(off_by(m, there))
    if (kind == "person") == bool(refusal) and refusal:
        print(house_text(stage, kind, there, with_depth, refusal))


def off_by(m: Measured, there: Pose2D) -> float:
    """Error of a place [m]."""
    return math.hypot(m.x - there.x, m.y - there.y)


def house_text(stage: Stage, kind: str, there: Pose2D, box: Box, refusal: str) -> str:
    """A line about a rejected person."""
    return f"{kind} at ({there.x:.1f}, {there.y:.1f}) seen from {stage.engine.pose}: {refusal}; {box.measured}"


def report(errors: dict[str, list[float]], told: dict[str, Counter[str]], file: Path | None) -> None:
    """Print the tables."""
    figures: dict[str, float] = {}
    in_workspace.require_figures([e for found in errors.values() for e in found], "no person was measured")
    print("| place by | persons | median off [m] | 95 % | within 0.3 m |\n|---|---|---|---|---|")
    for source, values in errors.items():
        if values:
            off = np.array(values)
            within = float((off <= 0.3).mean())
            print(f"| {source} | {len(off)} | {np.median(off):.2f} | {np.quantile(off, 0.95):.2f} | {within:.0%} |")
            figures |= {f"{source}_median": float(np.median(off)), f"{source}_within": within}
    for kind, counts in told.items():
        print(kind, dict(counts))
    if file:
        file.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
