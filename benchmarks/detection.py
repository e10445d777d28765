#!/usr/bin/env python3
"""The detector: time per picture compared with Debian's darknet, memory, quality; and the cost of republish.

    python3 benchmarks/detection.py [--json FILE] [--repeats N]

- yolov2_tiny_ms: from the bytes of a sensor_msgs/Image (640x480 rgb8) to the bytes of a BoundingBoxes message, with
  yolov2-tiny at 416 and random weights, pinned to two cores: all of the node's work except transport.
- yolov2_tiny_vs_darknet: forward pass of Debian's own library (package `darknet`) on the same cfg, weights and picture,
  divided by yolov2_tiny_ms.
- house_net_fps: the same as a rate, for the network in models/, on one core.
- house_net_mb: resident memory of a process that has done so and drawn boxes, with rospy loaded.
- recall, precision, house_net_ap: on the 2,000 test pictures (drawn first), counted as in `training/scoring.py`, at the
  shipped threshold; with a table by distance, visibility and light.
- republish_vs_imencode: message bytes in to message bytes out, divided by `cv2.imencode` of the picture alone.

The figures are wall times and need an idle machine. Those that end in `_cpu` are processor time, for a busy machine
(for yolov2-tiny the sum of both threads). A figure that cannot be measured here (no weights, no darknet) is left out,
and the table gives the reason.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import io
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
AIMS = {
    "yolov2_tiny_ms": "<= 35",
    "yolov2_tiny_vs_darknet": ">= 12",
    "house_net_fps": ">= 60",
    "house_net_mb": "<= 220",
    "recall": ">= 0.99",
    "precision": ">= 0.995",
    "republish_vs_imencode": "<= 1.3",
}
PARTS = ("tiny", "house", "quality", "republish")
LIBRARY = Path("/usr/lib/darknet/libdarknet.so")
REFERENCE = ROOT / "test/contract/darknet_reference.py"
CFG = ROOT / "drop_in/darknet_ros/yolo_network_config/cfg/yolov2-tiny.cfg"


def make_picture() -> np.ndarray:
    """Make a picture of soft colours with some noise, shape (480, 640, 3)."""
    rng = np.random.default_rng(1)
    blocks = np.kron(rng.integers(0, 255, (24, 32, 3)), np.ones((20, 20, 1)))
    return np.clip(blocks + rng.normal(0.0, 4.0, blocks.shape), 0, 255).astype(np.uint8)


class Times(NamedTuple):
    """Median milliseconds of wall time and of processor time."""

    wall: float
    cpu: float


def medians(repeats: int, *actions: Callable[[], object]) -> list[Times]:
    """Time each action after a warm-up, interleaved so that all get the same machine load."""
    times: list[list[tuple[float, float]]] = [[] for _ in actions]
    for turn in range(repeats + 3):
        for action, seen in zip(actions, times, strict=True):
            start, used = time.perf_counter(), time.process_time()
            action()
            if turn >= 3:
                seen.append((time.perf_counter() - start, time.process_time() - used))
    return [Times(*(statistics.median(column) * 1e3 for column in zip(*seen, strict=True))) for seen in times]


def message_bytes() -> bytes:
    """A picture message as received."""
    from std_msgs.msg import Header

    from rosbot_patrol.images.encodings import Picture
    from rosbot_patrol.ros.messages.images import picture_to_msg

    out = io.BytesIO()
    picture_to_msg(Picture(make_picture(), "rgb8"), Header()).serialize(out)
    return out.getvalue()


def detection_ms(cfg: str, weights: str, names: list[str], threads: int, repeats: int) -> Times:
    """Time from message bytes to message bytes."""
    from sensor_msgs.msg import Image

    from rosbot_patrol.detection.detector import load_detector
    from rosbot_patrol.ros.detector.node import boxes_to_msg
    from rosbot_patrol.ros.messages.images import picture_from_msg

    detector = load_detector(cfg, weights, names, threads=threads)
    data = message_bytes()

    def once() -> None:
        message = Image().deserialize(data)
        found = detector.detect(picture_from_msg(message))
        boxes_to_msg(found, message.header).serialize(io.BytesIO())

    return medians(repeats, once)[0]


def draw_one() -> None:
    """Draw as the node does for a subscriber of `detection_image`; the memory for it stays allocated."""
    from rosbot_patrol.detection.detector import Detection
    from rosbot_patrol.detection.draw import draw_boxes
    from rosbot_patrol.images.encodings import Picture

    draw_boxes(Picture(make_picture(), "rgb8"), [Detection(0, "person", 0.9, 100, 80, 220, 400)])


def republish_times(repeats: int) -> list[Times]:
    """Milliseconds from message bytes to message bytes, and of imencode alone."""
    import cv2
    from sensor_msgs.msg import CompressedImage, Image

    from rosbot_patrol.images.compressed import CompressedParams, compress
    from rosbot_patrol.ros.messages.images import picture_from_msg

    cv2.setNumThreads(1)
    params, data = CompressedParams(), message_bytes()
    pixels = make_picture()

    def once() -> None:
        message = Image().deserialize(data)
        text, coded = compress(picture_from_msg(message), params)
        CompressedImage(header=message.header, format=text, data=coded).serialize(io.BytesIO())

    return medians(repeats, once, lambda: cv2.imencode(".jpg", pixels, params.options()))


def darknet_ms(folder: Path, classes: int) -> Times:
    """Time a forward pass of Debian's darknet."""
    files = [str(CFG), str(folder / "tiny.weights"), str(folder / "picture.png")]
    command = [sys.executable, str(REFERENCE), *files, str(classes), "0.3", "0.4", "5"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    told = json.loads(done.stdout.splitlines()[-1])
    return Times(statistics.median(told["ms"][1:]), statistics.median(told["cpu_ms"][1:]))


def write_tiny(folder: Path) -> int:
    """Write yolov2-tiny with random weights and the picture; returns the number of classes."""
    import cv2

    from rosbot_patrol.detection.darknet.cfg import read_cfg
    from rosbot_patrol.detection.darknet.random_weights import random_weights
    from rosbot_patrol.detection.darknet.weights import format_weights

    spec = read_cfg(str(CFG))
    weights = random_weights(spec, np.random.default_rng(0))
    (folder / "tiny.weights").write_bytes(format_weights(spec, weights))
    cv2.imwrite(str(folder / "picture.png"), make_picture()[:, :, ::-1])
    return spec.classes


def quality(folder: Path) -> tuple[dict[str, float], str]:
    """Quality of our network on pictures that its training never saw, with the whole table."""
    import yaml

    sys.path.insert(0, str(ROOT))  # training/ is not part of the installed package
    from training.judging.report import find_all, load_forward
    from training.judging.scoring import average_precision, figures, groups, say
    from training.learning.dataset import Pictures

    draw = [sys.executable, "-m", "training.pictures.render", str(folder), "--set", "test"]
    subprocess.run(draw, cwd=ROOT, check=True, capture_output=True, text=True)
    cfg, weights = ROOT / "models/house.cfg", ROOT / "models/house.weights"
    shipped = yaml.safe_load((ROOT / "models/house.yaml").read_text(encoding="utf-8"))["yolo_model"]["threshold"][
        "value"
    ]
    found = find_all(Pictures.open(folder, "test"), cfg, load_forward(cfg, weights))
    result = figures(found, shipped)
    aimed = next(iter(groups(found)))
    return {
        "recall": result[f"{aimed}: found"] / result[f"{aimed}: there"],
        "precision": 1 - result["person: false"] / result["person: boxes"],
        "house_net_ap": average_precision(found, 0),
    }, say(result)


def resident_mb() -> float:
    """Resident memory of this process."""
    with open("/proc/self/status", encoding="ascii") as status:
        return next(int(line.split()[1]) / 1024 for line in status if line.startswith("VmRSS"))


def part(name: str, repeats: int, folder: Path) -> dict[str, float]:
    """Run one part of the measurement, in a process of its own."""
    if name == "tiny":
        pin(2)
        classes = write_tiny(folder)
        ours = detection_ms(str(CFG), str(folder / "tiny.weights"), [str(i) for i in range(classes)], 2, repeats)
        figures = {"yolov2_tiny_ms": ours.wall, "yolov2_tiny_cpu": ours.cpu}
        if LIBRARY.exists():
            theirs = darknet_ms(folder, classes)
            figures["darknet_ms"], figures["darknet_cpu"] = theirs
            figures["yolov2_tiny_vs_darknet"] = theirs.wall / ours.wall
        return figures
    if name == "house":
        pin(1)
        models = ROOT / "models"
        cfg, weights = str(models / "house.cfg"), str(models / "house.weights")
        ms = detection_ms(cfg, weights, ["person", "fire hydrant"], 1, 5 * repeats)
        draw_one()
        return {"house_net_fps": 1000.0 / ms.wall, "house_net_fps_cpu": 1000.0 / ms.cpu, "house_net_mb": resident_mb()}
    if name == "quality":
        result, table = quality(folder)
        print(table, file=sys.stderr)
        return result
    pin(1)
    ours, theirs = republish_times(5 * repeats)
    return {
        "republish_ms": ours.wall,
        "imencode_ms": theirs.wall,
        "republish_vs_imencode": ours.wall / theirs.wall,
        "republish_vs_imencode_cpu": ours.cpu / theirs.cpu,
    }


def pin(cores: int) -> None:
    """Pin this process to `cores` cores."""
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:cores])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--repeats", type=int, default=30)
    parser.add_argument("--part", choices=PARTS, help=argparse.SUPPRESS)
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.part:
        print(json.dumps(part(arguments.part, arguments.repeats, arguments.folder)))
        return
    figures: dict[str, float] = {}
    failed = []
    with tempfile.TemporaryDirectory() as folder:
        for name in PARTS:
            command = [sys.executable, __file__, "--part", name, "--repeats", str(arguments.repeats)]
            done = subprocess.run([*command, "--folder", folder], capture_output=True, text=True, check=False)
            if done.returncode:
                failed.append(name)
                said = done.stderr.strip().splitlines() or [f"ended with {done.returncode}"]
                print(f"{name}: {said[-1]}", file=sys.stderr)
                continue
            figures |= json.loads(done.stdout.splitlines()[-1])
            if name == "quality":
                print(done.stderr, file=sys.stderr)
    if not LIBRARY.exists():
        print("yolov2_tiny_vs_darknet: Debian's package darknet is not installed", file=sys.stderr)
    in_workspace.require_figures(figures, f"no part gave figures, all failed: {', '.join(failed)}")
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}\n\n| figure | value | aim |\n|---|---|---|")
    for name, value in figures.items():
        print(f"| {name} | {value:.2f} | {AIMS.get(name, '')} |")
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    if failed:
        sys.exit(f"detection.py: no figures of: {', '.join(failed)}")


if __name__ == "__main__":
    main()
