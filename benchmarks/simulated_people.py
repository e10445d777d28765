#!/usr/bin/env python3
"""Simulated people before networks that know real ones: who is found, and what else is taken for a person.

    benchmarks/simulated_people.py [--pictures N] [--empty N] [--seed N] [--plain] [--reserved]
                                   [--network FILE.cfg[:THRESHOLD]]... [--sheet FILE] [--misses FILE] [--json FILE]

The program draws pictures with one person 1 to 6 m away, at least half of the figure seen, and pictures without a
person. Half of the scenes are the villa of `test/test_pictures`, half are random rooms, with furniture, pets and
hydrants; 640 x 480, with the camera's noise. No posters of people hang there, because a network may call such a poster
a person. Every network sees the same pictures.

- simulated_found: share of the persons whom a box of the class `person` overlaps by an IoU of 0.4 or more.
- simulated_empty_boxes: pictures without a person in which the network has a box of a person.

Without `--network` the networks are the one in `models/` and, where they are, ssdlite and yolo-fastest-1.1-xl of
`../shared/people`. `--network ssdlite` is that one, any other a darknet file with its weights and coco.names beside it.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))  # training/ is not part of the installed package

from rosbot_patrol.detection.detector import Detector, load_detector, read_names  # noqa: E402
from rosbot_patrol.detection.ssdlite import load_ssdlite  # noqa: E402
from rosbot_patrol.errors import DetectorError  # noqa: E402
from rosbot_patrol.images.encodings import Picture  # noqa: E402
from rosbot_patrol.simulation.render.egl import EglRenderer  # noqa: E402
from rosbot_patrol.simulation.scene.textures import standard_textures  # noqa: E402
from rosbot_patrol.simulation.sdf.world import load_world  # noqa: E402
from training.judging.test_set import WORLD, unseen_textures  # noqa: E402
from training.pictures import scenes  # noqa: E402
from training.pictures.furniture import placed  # noqa: E402
from training.pictures.render import eye  # noqa: E402
from training.pictures.visibility import silhouette  # noqa: E402

PUBLIC = ROOT / "../shared/people/networks/yolo-fastest-1.1-xl.cfg"
PUBLIC_THRESHOLD = 0.4
DISTANCES = (1.0, 2.0, 3.0, 4.5, 6.0)
SHARES = (0.5, 0.7, 0.9, 1.01)
HIT = 0.4
NOISE = 2.0
VIEWS = 5
TILE = 240, 180
"""Width and height of a picture on a sheet [px]."""


@dataclass(frozen=True)
class Shot:
    """A picture, and its person if it has one.

    Attributes:
        pixels: RGB, uint8, shape (480, 640, 3).
        box: x0, y0, x1, y1 of the visible part [px], None without a person.
        groups: name of a property -> its value.
    """

    pixels: NDArray[np.uint8]
    box: tuple[int, int, int, int] | None = None
    groups: dict[str, str] = field(default_factory=dict)


@dataclass
class Studio:
    """Draws scenes, cameras and persons from one seed."""

    rng: np.random.Generator
    detailed: bool = True
    reserved: bool = False
    renderer: EglRenderer = field(init=False)

    def __post_init__(self) -> None:
        self.renderer = EglRenderer(textures=unseen_textures() if self.reserved else standard_textures())

    def shots(self, count: int, *, person: bool) -> Iterator[Shot]:
        """Draw so many pictures, VIEWS of each scene at most."""
        villa = load_world(ROOT / WORLD)
        made = scene_number = 0
        while made < count:
            in_villa = scene_number % 2 == 0
            scene = scenes.draw_house(self.rng, villa) if in_villa else scenes.draw_room(self.rng)
            scene_number += 1
            self._enter(scene, "villa" if in_villa else "room")
            for _ in range(VIEWS):
                shot = self._take(scene, person=person) if made < count else None
                if shot is not None:
                    made += 1
                    yield shot

    def _enter(self, scene: scenes.Scene, kind: str) -> None:
        self._kind = kind
        self.renderer.clear()
        self.renderer.light = scene.light
        for body in scene.bodies:
            if not any(visual.material.texture.startswith("poster") for visual in body.visuals):
                self.renderer.add(body)

    def _take(self, scene: scenes.Scene, *, person: bool) -> Shot | None:
        camera = scenes.draw_camera(scene, self.rng, open_view=True)
        spot = scenes.find_spot(scene, camera, self.rng, most=0.0) if camera else None
        if camera is None or spot is None:
            return None
        actors = []
        if person:
            pose = placed(*spot, 0.0, float(self.rng.uniform(-np.pi, np.pi)))
            actors.append(scenes.draw_person(self.rng, "someone", pose, self.reserved, detailed=float(self.detailed)))
        other = scenes.find_spot(scene, camera, self.rng) if self.rng.random() < 0.4 else None
        if other is not None and self.rng.random() < 0.7:
            actors.append(scenes.draw_animal(self.rng, "pet", other))
        elif other is not None:
            actors.append(scenes.draw_hydrant(self.rng, "hydrant", placed(*other), False))
        with_actors = self._draw(actors, camera)
        return with_actors if not person else self._checked(with_actors, actors[0], camera, spot)

    def _draw(self, actors: list[scenes.Actor], camera: tuple[float, float, float]) -> Shot:
        for number, actor in enumerate(actors):
            self.renderer.add(actor.body, label=number + 1)
            self.renderer.move(actor.body.name, actor.pose)
            if actor.parts is not None:
                self.renderer.pose_visuals(actor.body.name, actor.parts)
            for extra in actor.extra:
                self.renderer.add(extra)
                self.renderer.move(extra.name, extra.pose)
        self._optics = eye(camera, self.rng)
        drawn = self.renderer.render_labelled(*self._optics)
        for actor in actors:
            for body in (actor.body, *actor.extra):
                self.renderer.remove(body.name)
        noise = self.rng.normal(0.0, NOISE, (480, 640, 3))
        pixels = np.clip(drawn[:, :, :3] + noise, 0, 255).astype(np.uint8)
        self._mask = drawn[:, :, 3]
        return Shot(pixels)

    def _checked(
        self, shot: Shot, actor: scenes.Actor, camera: tuple[float, float, float], spot: tuple[float, float]
    ) -> Shot | None:
        """Add the person's box and groups; None where too little is seen."""
        distance = float(np.hypot(spot[0] - camera[0], spot[1] - camera[1]))
        seen = self._mask == 1
        pixels = int(seen.sum())
        whole, _ = silhouette(actor, *self._optics)
        share = pixels / max(whole, pixels, 1)
        if not (DISTANCES[0] <= distance <= DISTANCES[-1] and share >= SHARES[0]):
            return None
        columns, rows = np.flatnonzero(seen.any(axis=0)), np.flatnonzero(seen.any(axis=1))
        box = int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
        light = float(shot.pixels.mean())
        groups = {
            "place": self._kind,
            "posture": actor.posture,
            "distance": _span(distance, DISTANCES) + " m",
            "seen": _span(share, SHARES),
            "head": "cut" if rows[0] == 0 else "in the picture",
            "light": "dark" if light < 60 else "usual",
        }
        return Shot(shot.pixels, box, groups)


def _span(value: float, edges: tuple[float, ...]) -> str:
    k = min(int(np.searchsorted(edges, value, side="right")), len(edges) - 1)
    return f"{edges[k - 1]:g} to {min(edges[k], 1.0) if edges[-1] < 2 else edges[k]:g}"


@dataclass
class Result:
    """What one network found: for each shot its boxes of persons, and whether the person is found."""

    network: str
    boxes: list[NDArray[Any]]
    found: list[bool]


def judge(name: str, detector: Detector, shots: list[Shot]) -> Result:
    """Run a network on all shots."""
    boxes = []
    for shot in shots:
        found = detector.detect(Picture(shot.pixels, "rgb8"))
        persons = [(d.xmin, d.ymin, d.xmax, d.ymax, d.probability) for d in found if d.name == "person"]
        boxes.append(np.array(persons, float).reshape(-1, 5))
    hits = [s.box is not None and bool((_iou(s.box, b) >= HIT).any()) for s, b in zip(shots, boxes, strict=True)]
    return Result(name, boxes, hits)


def _iou(box: tuple[int, int, int, int], others: NDArray[Any]) -> NDArray[Any]:
    low, high = np.maximum(others[:, :2], box[:2]), np.minimum(others[:, 2:4], box[2:])
    common = np.prod(np.maximum(high - low, 0.0), axis=1)
    areas = np.prod(others[:, 2:4] - others[:, :2], axis=1) + (box[2] - box[0]) * (box[3] - box[1])
    shares: NDArray[Any] = common / np.maximum(areas - common, 1.0)
    return shares


def load_networks(wanted: list[str]) -> dict[str, Detector]:
    """The networks to judge, by name."""
    if not wanted:
        settings = yaml.safe_load((ROOT / "models/house.yaml").read_text(encoding="utf-8"))["yolo_model"]
        wanted = [f"{ROOT / 'models/house.cfg'}:{settings['threshold']['value']}"]
        wanted += ["ssdlite"] if _has_ssdlite() else []
        wanted += [f"{PUBLIC}:{PUBLIC_THRESHOLD}"] if PUBLIC.exists() else []
    networks: dict[str, Detector] = {}
    for text in wanted:
        if text == "ssdlite":
            networks[text] = load_ssdlite()
            continue
        file, _, threshold = text.partition(":")
        cfg = Path(file)
        names = ["person", "fire hydrant"] if cfg.stem == "house" else _names(cfg)
        networks[cfg.stem] = load_detector(
            str(cfg), str(cfg.with_suffix(".weights")), names, threshold=float(threshold or 0.3)
        )
    return networks


def _has_ssdlite() -> bool:
    try:
        load_ssdlite()
    except DetectorError as err:
        print(f"without ssdlite: {err}")
        return False
    return True


def _names(cfg: Path) -> list[str]:
    from rosbot_patrol.detection.darknet.cfg import read_cfg

    return read_names(str(cfg.parent / "coco.names"), read_cfg(str(cfg)))


def table(results: list[Result], shots: list[Shot]) -> str:
    """Share of persons found, by group and network."""
    lines = ["| persons | number | " + " | ".join(r.network for r in results) + " |", "|---" * (2 + len(results)) + "|"]
    keys = sorted({(k, v) for shot in shots for k, v in shot.groups.items()})
    for key, value in [("all", ""), *keys]:
        chosen = [i for i, s in enumerate(shots) if s.box and (key == "all" or s.groups[key] == value)]
        shares = [f"{np.mean([r.found[i] for i in chosen]):.3f}" for r in results]
        lines.append(f"| {key} {value} | {len(chosen)} | " + " | ".join(shares) + " |")
    return "\n".join(lines)


def write_sheet(path: Path, shots: list[Shot], result: Result, chosen: list[int]) -> None:
    """Write small pictures side by side: the person green where found, red where missed, other boxes yellow."""
    tiles = []
    for i in chosen:
        tile = shots[i].pixels.copy()
        for box in result.boxes[i]:
            cv2.rectangle(tile, *_corners(box), (255, 220, 0), 2)
        if shots[i].box is not None:
            cv2.rectangle(tile, *_corners(shots[i].box), (0, 200, 0) if result.found[i] else (255, 0, 0), 2)
        tiles.append(cv2.resize(tile, TILE, interpolation=cv2.INTER_AREA))
    columns = max(min(6, len(tiles)), 1)
    tiles += [np.zeros((TILE[1], TILE[0], 3), np.uint8)] * (-len(tiles) % columns)
    rows = [np.hstack(tiles[k : k + columns]) for k in range(0, len(tiles), columns)]
    cv2.imwrite(str(path), cv2.cvtColor(np.vstack(rows), cv2.COLOR_RGB2BGR))


def _corners(box: Any) -> tuple[tuple[int, int], tuple[int, int]]:
    return (int(box[0]), int(box[1])), (int(box[2]), int(box[3]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=int, default=500, help="number of pictures with a person")
    parser.add_argument("--empty", type=int, default=214, help="number of pictures without")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--plain", action="store_true", help="people with plain figures")
    parser.add_argument("--reserved", action="store_true", help="looks, postures and textures reserved for tests")
    parser.add_argument("--network", action="append", default=[], metavar="FILE.cfg[:THRESHOLD]")
    parser.add_argument("--sheet", type=Path, metavar="FILE.jpg", help="the first 60 persons, by the last network")
    parser.add_argument("--misses", type=Path, metavar="FILE.jpg", help="the first 60 errors of the last network")
    parser.add_argument("--json", type=Path, metavar="FILE")
    wanted = parser.parse_args()
    networks = load_networks(wanted.network)
    shots: list[Shot] = []
    for k, count in enumerate((wanted.pictures, wanted.empty)):
        studio = Studio(np.random.default_rng([wanted.seed, k]), not wanted.plain, wanted.reserved)
        shots += studio.shots(count, person=k == 0)
    results = [judge(name, detector, shots) for name, detector in networks.items()]
    in_workspace.require_figures(results, "there is no network to judge")
    report(wanted, shots, results)


def report(wanted: argparse.Namespace, shots: list[Shot], results: list[Result]) -> None:
    """Print the table and the figures; write the sheets."""
    print(table(results, shots))
    figures = {}
    for result in results:
        empty = [len(b) > 0 for s, b in zip(shots, result.boxes, strict=True) if s.box is None]
        there = [hit for s, hit in zip(shots, result.found, strict=True) if s.box is not None]
        figures[result.network] = {
            "simulated_found": round(float(np.mean(there)), 4) if there else None,
            "simulated_empty_boxes": sum(empty),
        }
        print(f"{result.network}: {figures[result.network]}, {len(empty)} pictures without a person")
    last = results[-1]
    persons = [i for i, shot in enumerate(shots) if shot.box is not None]
    errors = [i for i, s in enumerate(shots) if (not last.found[i] if s.box else len(last.boxes[i]) > 0)]
    if wanted.sheet:
        write_sheet(wanted.sheet, shots, last, persons[:60])
    if wanted.misses:
        write_sheet(wanted.misses, shots, last, errors[:60])
    if wanted.json:
        wanted.json.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
