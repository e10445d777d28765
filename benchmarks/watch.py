#!/usr/bin/env python3
"""What the guard decides on recorded turns, with each network: who is found, false alarms, empty rooms.

    python3 benchmarks/watch.py RECORDS.jsonl.gz [--calibration NETWORK=FILE]... [--json FILE]

The records come from benchmarks/record_turns.py. The belief sees the full turn, then up to four looks from elsewhere
that it chooses among the recorded ones. It is tried with the network's calibration at two thresholds of the detector,
and with the cautious calibration. The floor counts as seen. A person counts as visible with at least 1,000 pixels and
0.35 m in view.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import json
import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from places import world_files

from rosbot_patrol.geometry import Pose2D, angle_difference
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.patrol.belief.belief import Belief, PictureView
from rosbot_patrol.patrol.belief.calibration import CAUTIOUS, Calibration, read_calibration
from rosbot_patrol.patrol.belief.recorded import Look, Scene, read_scenes
from rosbot_patrol.patrol.belief.second_look import best_second_look
from rosbot_patrol.patrol.house.floor import Floor, floor_of
from rosbot_patrol.patrol.records.inputs import Frame
from rosbot_patrol.patrol.records.mission import Verdict
from rosbot_patrol.patrol.visibility.viewpoints import Viewpoint

LOOKS_MOST = 4
SAME = 1.5  # a confirmation this near to the person is of them [m]
FAR, ASIDE = 4.0, 0.1  # or in their direction, at a wrong distance [m], [rad]
TARGET = 1.2  # a recorded look this near to a place shows it [m]
Place = tuple[float, float]


@dataclass(frozen=True)
class Outcome:
    """What a decision made of a scene: verdict, places of the confirmed, pictures until the first, looks, why."""

    verdict: Verdict
    confirmed: tuple[Place | None, ...]
    pictures: int
    looks: int
    why: str = ""


class Decision:
    """The belief on one scene.

    Args:
        scene: to decide.
        floor: of its map.
        threshold: of the detector.
        calibration: of the network.
    """

    def __init__(self, scene: Scene, floor: Floor, threshold: float, calibration: Calibration) -> None:
        self._belief = Belief(calibration, threshold=threshold, floor=floor)
        self._belief.start(0.0)
        self._scene = scene
        self._told: set[int] = set()
        self.confirmed: list[Place | None] = []

    def see(self, frame: Frame, look: Look) -> None:
        """Take a picture."""
        for hypothesis in self._belief.see(frame.stamp or 0.0, frame, PictureView(look.sight, self._scene.is_dark)):
            if hypothesis.is_confirmed and hypothesis.number not in self._told:
                self._told.add(hypothesis.number)
                self.confirmed.append((float(hypothesis.place[0]), float(hypothesis.place[1])))

    def choose(self, looks: Sequence[Look]) -> Look | None:
        """The next look."""
        for hypothesis in self._belief.open:
            near = [k for k in looks if k.target and math.dist(k.target, hypothesis.place) < TARGET]
            views = {
                id(v): (v, k) for k in near for v in (Viewpoint(pose=eye_of(k).pose, turn=0.5, gain=0.0, way=1.0),)
            }
            best = best_second_look(self._belief, hypothesis, [v for v, _ in views.values()])
            if best is not None:
                hypothesis.second_looks.append(best.pose)
                return views[id(best)][1]
        return None

    def verdict(self) -> tuple[Verdict, str]:
        """The verdict."""
        found = self._belief.verdict(floor_seen=True)
        return found.verdict, found.why


def eye_of(look: Look):
    """The camera in the middle of a look."""
    frames = next(iter(look.frames.values()))
    eye = frames[len(frames) // 2].eye
    assert eye is not None
    return eye


def decide(decision: Decision, scene: Scene, network: str) -> Outcome:
    """Run a decision on a scene."""
    left, look, pictures, looks, first = list(scene.looks[1:]), scene.looks[0], 0, 0, 0
    while True:
        for frame in look.frames[network]:
            pictures += 1
            decision.see(frame, look)
            first = first or (pictures if decision.confirmed else 0)
        chosen = decision.choose(left) if looks < LOOKS_MOST and not decision.confirmed else None
        if chosen is None:
            break
        left = [k for k in left if k is not chosen]
        look, looks = chosen, looks + 1
    verdict, why = decision.verdict()
    return Outcome(verdict, tuple(decision.confirmed), first, looks, why)


def is_visible(scene: Scene) -> bool:
    """Whether enough of the person shows in the turn."""
    shown, subject = scene.looks[0].shown, scene.subject
    if not scene.has_person or shown is None or subject is None:
        return False
    sight = scene.looks[0].sight
    high = (shown.top - shown.bottom) * math.dist((sight.x, sight.y), subject[:2])
    return shown.pixels >= 1000 and high >= 0.35


def is_of(place: Place | None, person: Pose2D, scene: Scene) -> bool:
    """Whether a place is the person's, or lies in the same direction from the robot."""
    if place is None or math.dist(place, person[:2]) <= SAME:
        return True
    eyes = [eye_of(look).pose for look in scene.looks]
    return math.dist(place, person[:2]) <= FAR and any(
        abs(angle_difference(*(math.atan2(y - eye.y, x - eye.x) for x, y in (place, person[:2])))) <= ASIDE
        for eye in eyes
    )


@dataclass
class Row:
    """Counts of one decision with one network."""

    persons: int = 0
    visible: int = 0
    found: int = 0
    found_visible: int = 0
    false: int = 0
    clear: int = 0
    clear_visible: int = 0
    unverified: int = 0
    empty: int = 0
    empty_unverified: int = 0
    pictures: list[int] = field(default_factory=list)
    looks: int = 0

    def add(self, scene: Scene, outcome: Outcome) -> str:
        """Count a scene; what went wrong, "" for nothing."""
        here = scene.subject if scene.has_person else None
        right = [p for p in outcome.confirmed if here is not None and is_of(p, here, scene)]
        wrong = len(outcome.confirmed) - len(right)
        self.false += wrong > 0
        self.looks += outcome.looks
        if here is None:
            self.empty += 1
            self.empty_unverified += outcome.verdict is Verdict.UNVERIFIED
            return "false" if wrong else "unverified" if outcome.verdict is Verdict.UNVERIFIED else ""
        visible = is_visible(scene)
        self.persons += 1
        self.visible += visible
        self.found += bool(right)
        self.found_visible += bool(right) and visible
        self.clear += outcome.verdict is Verdict.CLEAR
        self.clear_visible += outcome.verdict is Verdict.CLEAR and visible
        self.unverified += outcome.verdict is Verdict.UNVERIFIED
        if right:
            self.pictures.append(outcome.pictures)
        return "false" if wrong else outcome.verdict.value if not right else ""

    def text(self, name: str) -> str:
        """A row of the table."""
        until = f"{np.median(self.pictures):.0f}" if self.pictures else "-"
        return (
            f"| {name} | {self.found_visible} of {self.visible} | {self.found} of {self.persons} | {self.false} "
            f"| {self.clear_visible} | {self.clear} | {self.unverified} | {self.empty_unverified} of {self.empty} "
            f"| {until} | {self.looks} |"
        )


COLUMNS = (
    "calibration, threshold",
    "visible persons confirmed",
    "all persons",
    "false",
    "clear, visible",
)
COLUMNS += ("clear, any person", "unverified", "empty unverified", "pictures", "looks")
HEAD = f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("records", type=Path, nargs="+")
    parser.add_argument("--calibration", action="append", default=[], metavar="NETWORK=FILE")
    parser.add_argument("--errors", action="store_true", help="list what went wrong")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    calibrations = {n: read_calibration(Path(f)) for n, f in (given.split("=", 1) for given in arguments.calibration)}
    scenes = [scene for path in arguments.records for scene in read_scenes(path)]
    in_workspace.require_figures(scenes, "the records hold no scene")
    with tempfile.TemporaryDirectory() as folder:
        worlds = {scene.world for scene in scenes}
        floors = {world: floor_of(read_map(world_files(world, Path(folder)).map)) for world in worlds}
    figures: dict[str, float] = {}
    for network in scenes[0].looks[0].frames:
        fitted = calibrations.get(network)
        decisions: dict[str, Callable[[Scene], Decision]] = {
            "cautious, 0.4": lambda s: Decision(s, floors[s.world], 0.4, CAUTIOUS),
        }
        if fitted is not None:
            for threshold in (0.4, 0.1):
                decisions[f"fitted, {threshold}"] = lambda s, c=fitted, t=threshold: Decision(s, floors[s.world], t, c)
        print(f"\n{network}: {len(scenes)} scenes\n\n{HEAD}")
        for name, make in decisions.items():
            row, errors = Row(), []
            for scene in scenes:
                outcome = decide(make(scene), scene, network)
                wrong = row.add(scene, outcome)
                if wrong:
                    errors.append(f"    {scene.number} {scene.kind} visible={is_visible(scene)} {wrong}: {outcome.why}")
            print(row.text(name))
            if arguments.errors:
                print("\n".join(errors))
            key = f"{network} {name}"
            figures |= {f"{key} confirmed": row.found_visible / max(row.visible, 1), f"{key} false": row.false}
            figures |= {f"{key} clear_with_somebody": row.clear_visible}
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
