"""Write a set of labelled pictures as shards on disk: seeded, by several processes, going on where it was left.

A shard NAME-0007.npz holds `boxes`, one row per visible actor (see `labels.py`), and what stands where in each picture
(`masks`, see `dataset.py`), and NAME-0007.npy the pictures as the network gets them (a 640 x 480 picture in
its letterbox), uint8, shape (count, 288, 384, 3); with --jpeg NAME-0007.jpegs.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import math
import multiprocessing
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.errors import PatrolError
from rosbot_patrol.simulation.actors.looks import Look
from rosbot_patrol.simulation.actors.people import person_body, person_pose_parts
from rosbot_patrol.simulation.render.egl import EglRenderer
from rosbot_patrol.simulation.render.lights import Light
from rosbot_patrol.simulation.scene.scene import Intrinsics, Matrix
from rosbot_patrol.simulation.scene.textures import SIDE, Texture
from rosbot_patrol.simulation.sdf.world import World, load_world
from training.judging.test_set import SETS, WORLD, unseen_textures
from training.learning.dataset import JPEGS, Packed, pack_masks
from training.learning.mixing import FURNITURE
from training.pictures import scenes
from training.pictures.cases import case_camera, draw_case, pick_case
from training.pictures.furniture import placed
from training.pictures.kinds import KINDS, MOST
from training.pictures.labels import COLUMNS, HEIGHT, WIDTH
from training.pictures.patterns import draw_textures
from training.pictures.visibility import contrast, silhouette

PER_SHARD = 500
VIEWS = 5
SHAPELESS = 0.3
FINDABLE = ("person", "fire_hydrant")
_FORWARD = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])


class Studio:
    """A renderer with textures of training, drawn anew for every shard, or with those that only tests have.

    Args:
        world: the house of a share of the scenes, or None.
        unseen: take the textures of the tests.
        detailed: share of people with detailed figures.
    """

    def __init__(self, world: World | None, *, unseen: bool = False, detailed: float = 0.0) -> None:
        self.world = world
        self.unseen = unseen
        self.detailed = detailed
        self.shapeless = 0.0 if unseen else SHAPELESS
        self.renderer: EglRenderer | None = None

    def furnish(self, rng: np.random.Generator) -> None:
        """Take textures, and posters that are made with them."""
        if self.unseen:
            rng = np.random.default_rng(100)
        textures = unseen_textures() if self.unseen else draw_textures(rng)
        painter = EglRenderer(textures=dict(textures))
        for i, look in enumerate(scenes.poster_looks(rng, reserved=self.unseen)):
            textures[f"poster{i}"] = _poster(painter, look, rng)
        painter.close()
        if self.renderer is not None:
            self.renderer.close()
        self.renderer = EglRenderer(textures=textures)

    def shard(
        self,
        seed: list[int],
        count: int,
        *,
        test: bool,
        house_share: float = 0.3,
        plain: bool = False,
        pets: float = 0.0,
        hard: float = 0.0,
        cases: float = 0.0,
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """`count` pictures, the rows of their labels, and masks; a share is taken in the house, if there is one.

        Args:
            seed: of all chance.
            count: of pictures.
            test: draw people whom training never draws.
            house_share: share of scenes in the house.
            plain: leave the house's colours, light and furniture as they are.
            pets: share of the pictures with cats or dogs.
            hard: share of what is hard to tell (`scenes.draw_actors`).
            cases: share of the views that are the cases in which networks err most (`cases.CASES`).
        """
        rng = np.random.default_rng(seed)
        self.furnish(np.random.default_rng([*seed, 1]))
        assert self.renderer is not None
        pictures: list[NDArray[Any]] = []
        rows: list[list[Any]] = []
        masks: list[NDArray[Any]] = []
        while len(pictures) < count:
            scene = self._scene(rng, house_share, plain)
            self.renderer.clear()
            self.renderer.light = scene.light
            things = itertools.cycle(range(FURNITURE, 256))
            for body in scene.bodies:
                is_thing = body.kind == "furniture" or body.name.startswith("thing")
                self.renderer.add(body, label=next(things) if is_thing else 0)
            for _ in range(VIEWS):
                case = pick_case(rng) if cases and rng.random() < cases else ""
                camera = case_camera(case, scene, rng) if case else scenes.draw_camera(scene, rng)
                if camera is None or len(pictures) == count:
                    break
                picture, labels, mask = self._view(scene, camera, rng, test=test, pets=pets, hard=hard, case=case)
                rows += [[len(pictures), *label] for label in labels]
                pictures.append(picture)
                masks.append(mask)
        return np.array(pictures), np.array(rows, np.float32).reshape(-1, len(COLUMNS)), np.array(masks)

    def _scene(self, rng: np.random.Generator, house_share: float, plain: bool) -> scenes.Scene:
        if self.world and rng.random() < house_share:
            return scenes.draw_house(rng, self.world, plain=plain, shapeless=self.shapeless)
        return scenes.draw_room(rng, shapeless=self.shapeless)

    def _view(
        self,
        scene: scenes.Scene,
        camera: tuple[float, float, float],
        rng: np.random.Generator,
        *,
        test: bool,
        pets: float = 0.0,
        hard: float = 0.0,
        case: str = "",
    ) -> tuple[NDArray[Any], list[list[Any]], NDArray[Any]]:
        assert self.renderer is not None
        if case:
            actors = draw_case(
                case, scene, camera, rng, reserved=test, shapeless=self.shapeless, detailed=self.detailed
            )
        else:
            actors = scenes.draw_actors(scene, camera, rng, reserved=test, pets=pets, hard=hard, detailed=self.detailed)
        for i, actor in enumerate(actors):
            self.renderer.add(actor.body, label=i + 1)
            self.renderer.move(actor.body.name, actor.pose)
            if actor.parts is not None:
                self.renderer.pose_visuals(actor.body.name, actor.parts)
            for extra in actor.extra:
                self.renderer.add(extra)
                self.renderer.move(extra.name, extra.pose)
        optical, intrinsics = eye(camera, rng)
        both = self.renderer.render_labelled(optical, intrinsics)
        picture, seen = cv2.cvtColor(both, cv2.COLOR_RGBA2RGB), cv2.extractChannel(both, 3)
        finished = degrade(picture, rng)
        shot = _Shot(finished, seen, optical, intrinsics, camera, float(picture.mean()))
        labels = [
            _label(actor, i + 1, shot, is_test=test) for i, actor in enumerate(actors) if actor.body.kind in FINDABLE
        ]
        for actor in actors:
            for body in (actor.body, *actor.extra):
                self.renderer.remove(body.name)
        mask = cv2.resize(seen, (WIDTH, HEIGHT), interpolation=cv2.INTER_NEAREST)
        return finished, [label for label in labels if label], mask


def degrade(picture: NDArray[Any], rng: np.random.Generator) -> NDArray[Any]:
    """What a camera, a turning robot and jpeg make of a picture, and the network's own reduction to 384 x 288."""
    out = picture
    if rng.random() < 0.7:
        gains = np.exp(rng.normal(0, 0.25)) * (1 + rng.normal(0, 0.05, 3))
        levels = np.clip(np.arange(256)[:, None] * gains / 255.0, 0, 1) ** np.exp(rng.normal(0, 0.2))
        out = cv2.LUT(out, (255.0 * levels).astype(np.uint8)[None])
    if rng.random() < 0.3:
        out = cv2.blur(out, (int(rng.integers(2, 15)), 1))
    if rng.random() < 0.15:
        out = cv2.GaussianBlur(out, (0, 0), float(rng.uniform(0.5, 1.3)))
    if rng.random() < 0.6:
        out = cv2.add(out, _noise(rng, float(rng.uniform(1, 9))), dtype=cv2.CV_8U)
    if rng.random() < 0.7:
        quality = 80 if rng.random() < 0.6 else int(rng.integers(45, 97))
        out = cv2.imdecode(cv2.imencode(".jpg", out, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_COLOR)
    return reduce(out, exact=rng.random() < 0.8)


@functools.cache
def _noise_bank() -> NDArray[Any]:
    return np.random.default_rng(5).normal(0, 20, (1200, 1200, 3)).astype(np.int16)


def _noise(rng: np.random.Generator, level: float) -> NDArray[Any]:
    """Noise of a standard deviation of `level`, cut out of a bank anywhere."""
    y, x = rng.integers(0, 700), rng.integers(0, 540)
    return _noise_bank()[y : y + 480, x : x + 640] * np.int16(level * 12.8) >> 8


def reduce(picture: NDArray[Any], *, exact: bool = True) -> NDArray[Any]:
    """640 x 480 to 384 x 288, as darknet's letterbox does it, or by area."""
    if not exact:
        by_area: NDArray[Any] = cv2.resize(picture, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
        return by_area
    x = np.linspace(0, picture.shape[1] - 1, WIDTH, dtype=np.float32)
    y = np.linspace(0, picture.shape[0] - 1, HEIGHT, dtype=np.float32)
    reduced: NDArray[Any] = cv2.remap(picture, *np.meshgrid(x, y), cv2.INTER_LINEAR)
    return reduced


def eye(camera: tuple[float, float, float], rng: np.random.Generator) -> tuple[Matrix, Intrinsics]:
    """Where a camera of the robot is, its optical frame in the world, and its lens: give or take what a robot sways."""
    x, y, yaw = camera
    pitch, roll = rng.normal(0, 0.012, 2)
    tilt = np.array([[1, 0, pitch, 0], [0, 1, -roll, 0], [-pitch, roll, 1, 0], [0, 0, 0, 1.0]])
    tilt[:3, :3] = np.linalg.qr(tilt[:3, :3])[0] * np.sign(np.diag(np.linalg.qr(tilt[:3, :3])[1]))
    zoom = float(rng.uniform(0.97, 1.03))
    height = 0.22 + float(rng.normal(0, 0.01))
    intrinsics = Intrinsics(fx=554.3827 * zoom, fy=554.3827 * zoom)
    return placed(x, y, height, yaw) @ tilt @ _FORWARD, intrinsics


@dataclass(frozen=True)
class _Shot:
    """A picture as the network gets it, and how it was taken.

    Attributes:
        finished: the picture, shape (288, 384, 3).
        seen: number of the actor at each pixel, shape (480, 640).
        optical: world_from_optical.
        intrinsics: the lens.
        camera: x, y, yaw.
        light: mean of all colours, before the camera's faults.
    """

    finished: NDArray[Any]
    seen: NDArray[Any]
    optical: Matrix
    intrinsics: Intrinsics
    camera: tuple[float, float, float]
    light: float


def _label(actor: scenes.Actor, value: int, shot: _Shot, *, is_test: bool) -> list[Any] | None:
    """Row of an actor without its picture's number (`labels.COLUMNS`), None if hardly a pixel of it is seen."""
    mask = shot.seen == value
    pixels = int(np.count_nonzero(mask))
    if pixels < 12:
        return None
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    whole, part = silhouette(actor, shot.optical, shot.intrinsics)
    distance = float(np.hypot(actor.pose[0, 3] - shot.camera[0], actor.pose[1, 3] - shot.camera[1]))
    kind = 0 if actor.body.kind == "person" else 1
    w, h = shot.intrinsics.width, shot.intrinsics.height
    corners = [columns[0] / w, rows[0] / h, (columns[-1] + 1) / w, (rows[-1] + 1) / h]
    shares = (pixels / max(whole, pixels), pixels / max(part, pixels))
    return [kind, *corners, distance, *shares, pixels, shot.light, is_test, contrast(shot.finished, mask), value]


def _poster(painter: EglRenderer, look: Look, rng: np.random.Generator) -> Texture:
    painter.clear()
    painter.light = Light(sky=tuple(rng.uniform(0.1, 1, 3)))
    painter.add(person_body("model", look))
    painter.move("model", placed(0, 0, 0, float(rng.uniform(2.2, 4.0))))
    painter.pose_visuals("model", person_pose_parts(look, float(rng.random()), bool(rng.random() < 0.5)))
    high = float(rng.uniform(0.7, 1.3))
    eye = placed(-3.0, 0.0, high) @ _FORWARD
    view = Intrinsics(width=SIDE, height=SIDE, fx=200.0, fy=150.0, cx=(SIDE - 1) / 2, cy=(SIDE - 1) / 2)
    return Texture(painter.render(eye, view)[0][::-1].copy(), 0.0)


@dataclass(frozen=True)
class Job:
    """A shard to be drawn.

    Attributes:
        target: its file.
        seed: of all chance.
        house: the world's file, or None.
        test: whether it is for tests.
        told: what `Studio.shard` is told.
        detailed: share of people with detailed figures.
        count: of pictures.
    """

    target: Path
    seed: tuple[int, int, int]
    house: Path | None
    test: bool
    told: dict[str, Any]
    detailed: float
    count: int = PER_SHARD


def draw(job: Job) -> str:
    """Draw a shard unless it is there; returns its file's name."""
    if job.target.exists():
        return job.target.name
    if os.nice(0) < 5:
        os.nice(5)
    cv2.setNumThreads(1)
    studio = studio_of(job.house, unseen=job.test, detailed=job.detailed)
    write_shard(job.target, *studio.shard([*job.seed], job.count, test=job.test, **job.told))
    return job.target.name


@functools.cache
def studio_of(house: Path | None, *, unseen: bool = False, detailed: float = 0.0) -> Studio:
    """This process's studio for the world of that file, or for rooms by chance."""
    return Studio(load_world(house) if house else None, unseen=unseen, detailed=detailed)


def write_shard(target: Path, pictures: NDArray[Any], boxes: NDArray[Any], masks: NDArray[Any]) -> None:
    """Write what `Studio.shard` gave, as jpegs where the name ends so; the file is there when it is whole."""
    np.savez(target.with_suffix(".npz"), boxes=boxes, **pack_masks(masks))
    part = target.with_suffix(".part" + target.suffix)
    if target.suffix == JPEGS:
        Packed.of(pictures).save(part)
    else:
        np.save(part, pictures)
    part.rename(target)


def _jobs(
    options: argparse.Namespace, name: str, pictures: float, seed: int, house: Path | None, **told: Any
) -> list[Job]:
    """The shards of a set."""
    test = options.set is not None
    targets = [
        options.folder / f"{name}-{k:04d}{JPEGS if options.jpeg else '.npy'}"
        for k in range(math.ceil(pictures / PER_SHARD))
    ]
    return [Job(target, (seed, k, int(test)), house, test, told, options.detailed) for k, target in enumerate(targets)]


def _jobs_of_kinds(options: argparse.Namespace) -> list[Job]:
    """The shards of all kinds of training pictures."""
    jobs = []
    for kind in KINDS:
        pictures, house = options.pictures * kind.parts / MOST, kind.world(options.worlds)
        jobs += _jobs(options, kind.name(options.seed), pictures, options.seed + kind.offset, house, **kind.told)
    return jobs


def _jobs_asked_for(options: argparse.Namespace) -> list[Job]:
    if options.kinds:
        return _jobs_of_kinds(options)
    if options.set is not None:
        chosen = SETS[options.set]
        told = {"house_share": chosen.house_share, "pets": chosen.pets}
        return _jobs(options, options.set, chosen.pictures, chosen.seed, WORLD, **told)
    told = {name: getattr(options, name) for name in ("house_share", "plain", "pets", "hard", "cases")}
    return _jobs(options, options.name, options.pictures, options.seed, options.house, **told)


def main() -> None:
    """Make sets from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--name", default="train")
    parser.add_argument("--pictures", type=int, default=20000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--house", type=Path, help="a world in which a share of the pictures is taken")
    parser.add_argument("--house-share", type=float, default=0.3)
    parser.add_argument("--plain", action="store_true", help="leave the house as it is")
    parser.add_argument("--pets", type=float, default=0.0, help="share of the pictures with cats or dogs")
    parser.add_argument("--hard", type=float, default=0.0, help="share of people behind things, of pets nearby")
    parser.add_argument("--cases", type=float, default=0.0, help="share that is a case of cases.CASES")
    parser.add_argument("--detailed", type=float, default=0.0, help="share of people with detailed figures")
    parser.add_argument("--jpeg", action="store_true", help="keep the pictures as jpegs, a seventh as large")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--set", choices=SETS, help="draw these pictures of the tests, which test_set.py lays down")
    which.add_argument("--kinds", action="store_true", help="draw all kinds of kinds.py; --pictures: of the commonest")
    parser.add_argument("--worlds", type=Path, default=Path("worlds"), help="where the houses of --kinds are")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--scheduler", metavar="ADDRESS", help="draw on the workers of this dask scheduler (afar.py)")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    jobs = _jobs_asked_for(options)
    try:
        for done, name in enumerate(_drawn(jobs, options), 1):
            sys.stdout.write(f"\r{done}/{len(jobs)} shards ({name}) ")
            sys.stdout.flush()
    except PatrolError as err:
        sys.exit(f"\n{err}")
    sys.stdout.write("\n")


def _drawn(jobs: Sequence[Job], options: argparse.Namespace) -> Iterator[str]:
    """The names of the shards, as they are done."""
    if options.scheduler:
        from training.pictures.afar import draw_afar

        yield from draw_afar(options.scheduler, jobs)
        return
    with multiprocessing.get_context("spawn").Pool(options.processes) as pool:
        yield from pool.imap_unordered(draw, jobs)


if __name__ == "__main__":
    main()
