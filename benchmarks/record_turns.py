#!/usr/bin/env python3
"""Record turns of the robot for the benchmark of the intruder decision: boxes of several networks, poses, truth.

    python3 benchmarks/record_turns.py FILE.jsonl.gz [--worlds house,drawn_2000001] [--scenes N] [--seed N]
        [--figures detailed] [--network NAME]...

A world is one of our houses, or drawn_SEED, drawn by chance. A network is what `network:=NAME` names.

Each scene is one place of the robot and one subject: nobody, a person, a person in the dark, a half hidden person, a
dog, a cat or a poster. The robot turns once with a picture every 4.3 degrees, as at 10 Hz, and then looks at the
subject, and at what looked most like a person, from up to four other places each. The records need no renderer:
`benchmarks/watch.py` decides on them and `scripts/calibrate_network` fits a network's calibration.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import gzip
import json
import math
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

import cv2
import numpy as np
from places import LOOKS, draw_places, is_inside, make_engine, world_files

from rosbot_patrol.campaign.houses.files import HouseFiles
from rosbot_patrol.detection.choice import open_network
from rosbot_patrol.detection.detector import Detector
from rosbot_patrol.errors import WorldError
from rosbot_patrol.geometry import Pose2D, angle_difference, compose, transform_points
from rosbot_patrol.images.encodings import Picture
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.patrol.house.floor import Floor, floor_of
from rosbot_patrol.patrol.intruder.lidar_motion import off_the_map
from rosbot_patrol.patrol.intruder.measure import Depth, Lens, View, measure
from rosbot_patrol.patrol.records.inputs import Box
from rosbot_patrol.patrol.visibility.coverage import sight_of_scan
from rosbot_patrol.simulation.engine import Engine
from rosbot_patrol.simulation.scene.matrices import from_pose2d
from rosbot_patrol.simulation.sdf.world import load_world

KINDS = ("nobody", "person", "hidden", "dark", "nobody", "person", "dog", "poster", "cat", "hidden")
STEP_DEG = 4.3  # of a turn at 0.75 rad/s, ten pictures a second
PERIOD = 0.1  # between two pictures [s]
LOWEST = 0.05  # threshold of the recorded boxes
DARK = 0.1  # share of the light that is left
SWEEP = 12  # pictures of a look from elsewhere
SUBJECT = "subject"


class Stage:
    """One world with its robot, its floor and the networks.

    Args:
        files: of the world.
        networks: by name.
        figures: plain or detailed people.
    """

    def __init__(self, files: HouseFiles, networks: dict[str, Detector], figures: str) -> None:
        self.world, self.networks = files.name, networks
        self.engine: Engine = make_engine(load_world(files.world), figures)
        self.floor: Floor = floor_of(read_map(files.map))
        k = self.engine.params.camera.intrinsics
        self.lens = Lens(fx=k.fx, fy=k.fy, cx=k.cx, cy=k.cy, width=k.width, height=k.height)

    def view(self) -> View:
        """The camera's present viewpoint."""
        mount = self.engine.robot.description.camera
        assert mount is not None
        pose = from_pose2d(self.engine.pose, self.engine.robot.description.base_height) @ mount.pose
        return View(self.lens, np.asarray(pose, np.float64))

    def look(self, light: float, rng: np.random.Generator) -> dict[str, Any]:
        """Take a picture; the measured boxes of each network."""
        self.engine.step()
        taken = self.engine.picture()
        colour = taken.colour
        if light < 1.0:
            dim = colour * light + rng.normal(0.0, 4.0, colour.shape)
            colour = np.clip(dim, 0, 255).astype(np.uint8)
        coded = cv2.imencode(".jpg", colour[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 80])[1]
        seen = Picture(np.ascontiguousarray(cv2.imdecode(coded, cv2.IMREAD_COLOR)[:, :, ::-1]), "rgb8")
        view, depth = self.view(), Depth(taken.depth, self.lens)
        off = off_the_map(self.floor, transform_points(self.engine.pose, self.engine.level_scan().points), 0.3)
        boxes = {}
        for name, network in self.networks.items():
            found = [
                Box(label=d.name, probability=d.probability, xmin=d.xmin, ymin=d.ymin, xmax=d.xmax, ymax=d.ymax)
                for d in network.detect(seen)
                if d.name == "person"
            ]
            boxes[name] = [_plain(measure(box, view, depth, off)) for box in found]
        eye = view.map_from_optical
        return {"eye": [float(eye[0, 3]), float(eye[1, 3]), view.yaw], "boxes": boxes}

    def sight(self) -> dict[str, Any]:
        """How far one can look from here."""
        level = self.engine.level_scan()
        found = sight_of_scan(level.scan, compose(self.engine.pose, level.pose), self.floor, 8.0)
        lengths = found.lengths.round(2).tolist()
        return {"x": found.x, "y": found.y, "first": found.first, "step": found.step, "lengths": lengths}

    def truth(self, subject: Pose2D | None) -> list[float] | None:
        """Bearings in map and slopes of what shows of the subject: left, right, top, bottom, pixels; None: nothing."""
        if subject is None:
            return None
        here = self.engine.pose
        self.engine.carry(here._replace(yaw=math.atan2(subject.y - here.y, subject.x - here.x)))
        view = self.view()
        shown = self.engine.picture(colour=False, depth=False).depth
        kept = self.engine.population._walkers.pop(SUBJECT)
        without = self.engine.picture(colour=False, depth=False).depth
        self.engine.population._walkers[SUBJECT] = kept
        self.engine.carry(here)
        rows, columns = np.nonzero(np.nan_to_num(without, posinf=50.0) - np.nan_to_num(shown, posinf=50.0) > 0.03)
        if len(rows) < 12:
            return None
        lens = self.lens
        left, right = (view.yaw - math.atan((float(c) - lens.cx) / lens.fx) for c in (columns.min(), columns.max()))
        top, bottom = ((lens.cy - float(r)) / lens.fy for r in (rows.min(), rows.max()))
        return [left, right, top, bottom, float(len(rows))]


def _plain(box: Box) -> dict[str, Any]:
    plain = {key: value for key, value in asdict(box).items() if value is not None and key != "label"}
    plain["probability"] = round(box.probability, 4)
    if box.measured is not None:
        kept = {k: round(v, 3) if isinstance(v, float) else v for k, v in plain["measured"].items()}
        known = ("is_flat", "has_legs")  # False there is not the same as unknown
        plain["measured"] = {k: v for k, v in kept.items() if v is not None and (v is not False or k in known)}
    return plain


class Recorder:
    """Writes one scene after the other."""

    def __init__(self, file: IO[str], stage: Stage, rng: np.random.Generator, number: int) -> None:
        self._file, self._stage, self._rng, self._number = file, stage, rng, number
        self._pictures = 0
        self._strongest: dict[str, tuple[float, float, float]] = {}

    def record(self, kind: str, place: Pose2D) -> bool:
        """Record a scene at a place; False if the subject finds no room."""
        stage, rng, engine = self._stage, self._rng, self._stage.engine
        subject = put(stage, kind, place, rng, self._number) if kind != "nobody" else None
        if kind != "nobody" and subject is None:
            return False
        light = DARK if kind == "dark" else 1.0
        scene = {"scene": self._number, "world": stage.world, "kind": kind, "subject": subject and list(subject)}
        self._write(
            scene | {"columns": stage.lens.width, "rows": stage.lens.height, "fx": stage.lens.fx, "light": light}
        )
        engine.carry(place)
        turns = [place.yaw + math.radians(i * STEP_DEG) for i in range(round(360.0 / STEP_DEG))]
        self._pictures_from(place, turns, subject, light, name="turn", target=None)
        targets = [] if subject is None else [(subject.x, subject.y)]
        targets += [(x, y) for _, x, y in self._strongest.values()]
        for target in targets:
            for seen_from in draw_looks(engine, place, target, rng):
                bearing = math.atan2(target[1] - seen_from.y, target[0] - seen_from.x)
                turns = [bearing - 0.25 + 0.5 * i / (SWEEP - 1) for i in range(SWEEP)]
                self._pictures_from(seen_from, turns, subject, light, name="look", target=target)
        if subject is not None:
            engine.population.remove(SUBJECT)
        return True

    def _pictures_from(
        self, place: Pose2D, yaws: list[float], subject: Pose2D | None, light: float, *, name: str, target: Any
    ) -> None:
        engine = self._stage.engine
        engine.carry(place._replace(yaw=yaws[0]))
        self._write(
            {"stage": name, "target": target, "truth": self._stage.truth(subject), "sight": self._stage.sight()}
        )
        for yaw in yaws:
            engine.carry(place._replace(yaw=yaw))
            picture = self._stage.look(light, self._rng)
            self._pictures += 1
            self._write({"stamp": round(self._pictures * PERIOD, 3)} | picture)
            if name == "turn":
                self._note_strongest(picture["boxes"], subject)
        self._pictures += 100  # the drive

    def _note_strongest(self, boxes: dict[str, Any], subject: Pose2D | None) -> None:
        """Remember what looked most like somebody and is not the subject."""
        for network, found in boxes.items():
            for box in found:
                m = box.get("measured")
                if m is None or m["error"] > 0.6 or box["probability"] < 0.2:
                    continue
                if subject is not None and math.hypot(m["x"] - subject.x, m["y"] - subject.y) < 1.2:
                    continue
                if box["probability"] > self._strongest.get(network, (0.0,))[0]:
                    self._strongest[network] = box["probability"], m["x"], m["y"]

    def _write(self, line: dict[str, Any]) -> None:
        self._file.write(json.dumps(line, default=float) + "\n")


def put(stage: Stage, kind: str, place: Pose2D, rng: np.random.Generator, number: int) -> Pose2D | None:
    """Put a subject about the place, in view at least in part; None if there is no room for it."""
    engine = stage.engine
    is_person = kind in ("person", "dark", "hidden")
    model = "person" if is_person else kind
    for _ in range(60):
        engine.carry(place)
        level = engine.level_scan()
        beam = int(rng.integers(len(level.scan.ranges)))
        bearing = place.yaw + level.pose.yaw + level.scan.angles[beam]
        wall = float(level.scan.ranges[beam])
        far = wall - 0.02 if kind == "poster" else float(rng.uniform(1.0, 6.5))
        if kind == "hidden":
            far = wall + float(rng.uniform(0.3, 1.5))
        elif kind != "poster" and far > wall - 0.4:
            continue
        if not 1.0 <= far <= 6.5:
            continue
        x, y = place.x + far * math.cos(bearing), place.y + far * math.sin(bearing)
        if kind == "hidden" and not stage.floor.is_free(x, y):
            continue
        turned = bearing + math.pi if kind == "poster" else float(rng.uniform(-3, 3))
        posture = str(rng.choice(["", "", "", "sitting", "crouching", "creeping"])) if is_person else ""
        look = str(rng.choice([*LOOKS, "", "", ""])) if is_person else ""
        there = Pose2D(x, y, turned)
        try:
            engine.population.spawn_actor(SUBJECT, model, look, there, posture=posture)
        except WorldError:
            continue
        truth = stage.truth(there)
        if truth is not None and (kind != "hidden" or truth[4] > 300) and (kind != "person" or truth[4] > 500):
            return there
        engine.population.remove(SUBJECT)
    return None


def draw_looks(
    engine: Engine, place: Pose2D, target: tuple[float, float], rng: np.random.Generator, most: int = 3
) -> Iterator[Pose2D]:
    """Places from which a target is seen anew: from other sides, with a free line at the lidar's height but for it."""
    taken = [math.atan2(place.y - target[1], place.x - target[0])]
    for _ in range(60):
        bearing, far = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(1.8, 3.5))
        if min(abs(angle_difference(bearing, other)) for other in taken) < 0.7:
            continue
        yaw = bearing + math.pi
        at = Pose2D(target[0] + far * math.cos(bearing), target[1] + far * math.sin(bearing), yaw)
        if not is_inside(engine, at):
            continue
        level = engine.level_scan()
        ahead = np.abs(np.asarray(level.pose.yaw + level.scan.angles + math.pi) % math.tau - math.pi).argmin()
        if float(level.scan.ranges[int(ahead)]) < far - 0.6:
            continue
        taken.append(bearing)
        yield at
        if len(taken) > most:
            return


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--worlds", default="house,office")
    parser.add_argument("--scenes", type=int, default=20, help="in each world")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--figures", choices=("plain", "detailed"), default="plain")
    parser.add_argument("--network", action="append", default=[], metavar="NAME", help="besides house")
    arguments = parser.parse_args()
    networks = {name: open_network(name, LOWEST).detector for name in ("house", *arguments.network)}
    rng, number = np.random.default_rng(arguments.seed), 1000 * arguments.seed
    with gzip.open(arguments.file, "wt", encoding="utf-8") as file, tempfile.TemporaryDirectory() as folder:
        for world in arguments.worlds.split(","):
            stage = Stage(world_files(world, Path(folder)), networks, arguments.figures)
            for place in draw_places(stage.engine, rng, arguments.scenes):
                kind = KINDS[number % len(KINDS)]
                number += 1
                is_there = Recorder(file, stage, rng, number).record(kind, place)
                sys.stderr.write(f"{world} {number} {kind}{'' if is_there else ': no room'}\n")
            stage.engine.close()
    in_workspace.require_figures([number], "no scene was recorded")


if __name__ == "__main__":
    main()
