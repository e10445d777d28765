"""What networks take for a person in the houses as they are, with nobody in them.

    python -m training.pictures.empty_views --cfg house.cfg --weights BEFORE.weights AFTER.weights

Views by chance, views of which the picture's edge cuts a thing, and those in which that thing is a plant: of one that
the edge cuts the crown is left, which looks like half a person. All networks see the same pictures; seeded.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.render.egl import EglRenderer
from rosbot_patrol.simulation.sdf.world import World, load_world
from training.judging.report import Forward, find_all, load_forward
from training.learning.dataset import Pictures
from training.pictures import scenes
from training.pictures.cases import case_camera
from training.pictures.labels import COLUMNS
from training.pictures.render import degrade, eye

HOUSES = ("house", "office", "flat")
KINDS = {"chance": "by chance", "edge": "of which the edge cuts a thing", "plant": "of which the edge cuts a plant"}
PERSON = 0


def views(world: World, kind: str, count: int, seed: int) -> Iterator[NDArray[Any]]:
    """Pictures of a world with nobody in it, as a network gets them: RGB, uint8, shape (288, 384, 3).

    Args:
        world: its colours, textures and light are left as they are.
        kind: one of `KINDS`.
        count: so many cameras are drawn; those outside the house, or for which there is no room, give no picture.
        seed: of where the camera is, and of what it and jpeg make of the picture.
    """
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    scene = scenes.draw_house(rng, world, plain=True)
    things = None
    if kind == "plant":
        things = [p for body in world.bodies if "plant" in body.name for p in scenes.footprints(body)]
        if not things:
            return
    renderer = EglRenderer()
    renderer.light = scene.light
    for body in scene.bodies:
        renderer.add(body)
    try:
        for _ in range(count):
            camera = scenes.draw_camera(scene, rng) if kind == "chance" else case_camera("edge", scene, rng, things)
            if camera is not None and _indoors(scene, camera[0], camera[1]):
                yield degrade(renderer.render(*eye(camera, rng))[0], rng)
    finally:
        renderer.close()


def _indoors(scene: scenes.Scene, x: float, y: float) -> bool:
    """Whether something stands within 9 m in six of eight directions."""
    return sum(scenes.reach(scene, x, y, yaw) < 9.0 for yaw in np.arange(8) * np.pi / 4) >= 6


def surest(shots: NDArray[Any], cfg: Path, forward: Forward) -> NDArray[Any]:
    """The probability of the surest person that a network sees in each of N pictures, shape (N,); 0 for none."""
    nobody = np.zeros((0, len(COLUMNS)), np.float32)
    boxes = find_all(Pictures([shots], [[nobody] * len(shots)]), cfg, forward).boxes
    persons = boxes[boxes[:, 1] == PERSON]
    most = np.zeros(len(shots))
    np.maximum.at(most, persons[:, 0].astype(int), persons[:, 2])
    return most


def _work(job: tuple[argparse.Namespace, str, str]) -> tuple[str, NDArray[Any]]:
    options, kind, house = job
    cv2.setNumThreads(1)
    world = load_world(options.worlds / f"{house}.world")
    shots = list(views(world, kind, options.views, options.seed))
    if not shots:
        return kind, np.zeros((0, len(options.weights)))
    forwards = [load_forward(options.cfg, file, threads=1) for file in options.weights]
    return kind, np.stack([surest(np.array(shots), options.cfg, forward) for forward in forwards], axis=1)


def main() -> None:
    """Count from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cfg", type=Path, required=True)
    parser.add_argument("--weights", type=Path, nargs="+", required=True)
    parser.add_argument("--views", type=int, default=1500, help="of each kind in each house")
    parser.add_argument("--worlds", type=Path, default=Path("worlds"))
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    os.environ["LP_NUM_THREADS"] = "1"  # Mesa's own threads, in each process
    jobs = [(options, kind, house) for kind in options.kinds for house in HOUSES]
    with multiprocessing.get_context("spawn").Pool(options.processes) as pool:
        results = pool.map(_work, jobs, chunksize=1)
    for kind in options.kinds:
        rows = np.concatenate([found for of, found in results if of == kind])
        for file, column in zip(options.weights, rows.T, strict=True):
            over = ", ".join(f"{int((column > t).sum())} above {t}" for t in (0.3, 0.4, 0.6))
            most = column.max(initial=0.0)
            sys.stdout.write(f"{len(rows)} views {KINDS[kind]}, {file}: {over}; the surest {most:.2f}\n")


if __name__ == "__main__":
    main()
