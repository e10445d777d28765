#!/usr/bin/env python3
"""People detectors on photographs that no simulator drew.

    python3 benchmarks/real_people.py [NETWORK ...] [--people FOLDER] [--networks FOLDER] [--second NAME]
                                      [--json FILE] [--sheet FILE.jpg]

Networks by name: house, hog, yolo-fastest-1.1-xl, ssdlite (all four by default), and any other with files in
darknet_ros's folders or in `--networks` (by default `networks/` of the photographs). Each has its own threshold.

- found, by height of the person as a share of the picture's (below 0.1, up to 0.3, `big_recall`: 0.3 and more), and
  precision, on COCO: an IoU of 0.4 or more finds somebody, see `people_scores.py`. The labels leave people out:
  look at `--sheet` before you count a false box.
- empty_alarms: pictures of COCO without a person that show a box.
- dark: big_recall with 10 % of the light and noise of 3 levels.
- legs: share of the crops that begin just below the hip of big whole persons of Penn-Fudan (`crop_legs`) in which a box
  has an IoU of 0.4 or more with the legs.
- AP: average precision on Penn-Fudan at an IoU of 0.5, of all boxes above 0.02.
- ms: a picture of 640 x 480 with a person on one core, by the wall (by processor time, for a busy machine); with a
  second opinion, of both networks; MB: resident memory of a process that has done so, with rospy loaded.

Figures without a network's name are those of the first of yolo-fastest-1.1-xl and ssdlite that is there; the others
carry the network's name in front. `--second` adds a row in which that network gives a second opinion.
"""

from __future__ import annotations

import in_workspace  # first: it finds the interpreter

# isort: split
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from people_networks import NAMES, REAL_CAMERAS, NetworkFinder, forget, look
from people_pictures import crop_legs, darken, find_people, read_set
from people_scores import average_precision, score

from rosbot_patrol.detection.detector import Detector
from rosbot_patrol.errors import PatrolError
from rosbot_patrol.images.encodings import Picture

REPEATS = 50
LOW = 0.02
Row = dict[str, float]


def measure_cost(detector: Detector, pixels: np.ndarray) -> Row:
    """Time and memory, in a process that has not loaded the photographs."""
    import rospy  # noqa: F401  # as in the node
    from sensor_msgs.msg import Image  # noqa: F401

    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    picture, times = Picture(pixels, "bgr8"), []
    for _ in range(REPEATS + 3):
        forget(detector)
        start, used = time.perf_counter(), time.process_time()
        detector.detect(picture)
        times.append((time.perf_counter() - start, time.process_time() - used))
    wall, cpu = (statistics.median(column) * 1e3 for column in zip(*times[3:], strict=True))
    with open("/proc/self/status", encoding="ascii") as status:
        resident = next(int(line.split()[1]) / 1024 for line in status if line.startswith("VmRSS"))
    return {"ms": wall, "ms_cpu": cpu, "mb": resident}


def measure_quality(finder: NetworkFinder, name: str, second: str, people: Path, sheet: Path | None) -> Row:
    """Figures on the photographs."""
    detector = finder.load_pair(name, second) if second else finder.load(name)
    coco, pedestrians = read_set(people, "coco"), read_set(people, "pennfudan")
    answers = look(detector, coco)
    light, dark = score(answers), score(look(detector, darken(coco)))
    legs = [bool((one.matches() >= 0).any()) for one in look(detector, list(crop_legs(pedestrians)))]
    ranked = look(detector if second else finder.load(name, LOW), pedestrians)
    if sheet:
        from people_sheet import draw_sheet

        false, missed = draw_sheet(coco, answers, sheet)
        print(f"{sheet}: {false} false boxes and {missed} missed big persons of {name}", file=sys.stderr)
    return {
        **{f"{size}_recall": light.recall(size) for size in light.there},
        **{f"{size}_there": light.there[size] for size in light.there},
        "precision": light.precision,
        "empty_alarms": light.alarms,
        "empty": light.empty,
        "legs": float(np.mean(legs)),
        "legs_there": len(legs),
        "dark": dark.recall("big"),
        "dark_empty_alarms": dark.alarms,
        "ap": average_precision(ranked),
    }


def measure_apart(arguments: argparse.Namespace, name: str, second: str, picture: Path) -> Row | None:
    """Measure a network in processes of its own; None if that is not possible, after saying why."""
    row: Row = {}
    for part in ("quality", "cost"):
        command = [sys.executable, __file__, name, "--part", part, "--picture", str(picture), "--second", second]
        command += ["--people", str(arguments.people), "--networks", str(arguments.networks)]
        command += ["--sheet", str(arguments.sheet)] if arguments.sheet and is_drawn(arguments, name, second) else []
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode:
            print(f"{label(name, second)}: {done.stdout.strip() or 'its process failed'}", file=sys.stderr)
            return None
        row |= json.loads(done.stdout.splitlines()[-1])
    return row


def default_of(names: Sequence[str]) -> str:
    """The network that figures without a name are of: the best for a real camera, else the first."""
    return next((name for name in REAL_CAMERAS if name in names), names[0])


def is_drawn(arguments: argparse.Namespace, name: str, second: str) -> bool:
    """Whether the sheet shows this one: the default, with the second opinion if one is asked for."""
    return (name, second) == (default_of(arguments.network), arguments.second)


def label(name: str, second: str) -> str:
    """Name of a row."""
    return f"{name} and {second}" if second else name


def do_part(arguments: argparse.Namespace) -> None:
    """Measure one network in this process, and print the figures."""
    (name,) = arguments.network
    finder = NetworkFinder(arguments.networks)
    try:
        if arguments.part == "cost":
            detector = finder.load_pair(name, arguments.second) if arguments.second else finder.load(name)
            row = measure_cost(detector, np.load(arguments.picture))
        else:
            row = measure_quality(finder, name, arguments.second, arguments.people, arguments.sheet)
    except PatrolError as err:
        print(err)
        sys.exit(1)
    print(json.dumps(row))


def say(rows: dict[str, Row]) -> str:
    """The table."""
    lines = [
        "| network | big found | 0.1 to 0.3 | smaller | precision | empty pictures that alarm | legs | 10 % light"
        " | Penn-Fudan AP | ms, one core (processor time) | MB |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, row in rows.items():
        cells = [f"{row[f'{size}_recall']:.0%} of {row[f'{size}_there']}" for size in ("big", "medium", "small")]
        cells += [f"{row['precision']:.2f}", f"{row['empty_alarms']} of {row['empty']}"]
        cells += [f"{row['legs']:.0%} of {row['legs_there']}", f"{row['dark']:.0%}", f"{row['ap']:.2f}"]
        cells += [f"{row['ms']:.1f} ({row['ms_cpu']:.1f})", f"{row['mb']:.0f}"]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def figures(rows: dict[str, Row], pair: str) -> dict[str, float]:
    """Figures under the names of FIGURES.md, and all others with the network's name in front.

    Args:
        rows: by network.
        pair: name of the row with a second opinion, "" for none.
    """
    named = {f"{name}_{figure}": value for name, row in rows.items() for figure, value in row.items()}
    default = next((rows[name] for name in REAL_CAMERAS if name in rows), None)
    if default:
        named |= {name: default[name] for name in ("big_recall", "empty_alarms", "legs", "dark")}
        named |= {"default_ms": default["ms"], "default_mb": default["mb"]}
    if pair in rows:
        named |= {"big_recall_two": rows[pair]["big_recall"], "empty_alarms_two": rows[pair]["empty_alarms"]}
    return named


def rows_of(arguments: argparse.Namespace) -> list[tuple[str, str]]:
    """Network and second opinion of each row."""
    pair = [(default_of(arguments.network), arguments.second)] if arguments.second else []
    return [*((name, "") for name in arguments.network), *pair]


def measure(arguments: argparse.Namespace) -> dict[str, Row]:
    """Rows of all networks that are there."""
    import cv2

    rows: dict[str, Row] = {}
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "picture.npy"
        somebody = next(one.pixels for one in read_set(arguments.people, "coco") if len(one.persons))
        np.save(picture, cv2.resize(somebody, (640, 480)))
        for name, second in rows_of(arguments):
            row = measure_apart(arguments, name, second, picture)
            if row is not None:
                rows[label(name, second)] = row
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("network", nargs="*", default=list(NAMES))
    parser.add_argument("--people", type=Path, metavar="FOLDER", help="the photographs; default: ../shared/people")
    parser.add_argument("--networks", type=Path, metavar="FOLDER", help="files of further networks")
    parser.add_argument("--second", default="", metavar="NAME", help="network that gives a second opinion")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--sheet", type=Path, metavar="FILE.jpg", help="draw what is wrong or missed")
    parser.add_argument("--part", choices=("quality", "cost"), help=argparse.SUPPRESS)
    parser.add_argument("--picture", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.part:
        do_part(arguments)
        return
    arguments.people = find_people(arguments.people)
    arguments.networks = arguments.networks or arguments.people / "networks"
    rows = measure(arguments)
    in_workspace.require_figures(rows, "none of the networks can be loaded")
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}\n\n{say(rows)}")
    if arguments.json:
        pair = label(default_of(arguments.network), arguments.second) if arguments.second else ""
        arguments.json.write_text(json.dumps(figures(rows, pair), indent=1) + "\n", encoding="utf-8")
    missing = [label(*row) for row in rows_of(arguments) if label(*row) not in rows]
    if missing:
        sys.exit(f"real_people.py: no figures of: {', '.join(missing)}")


if __name__ == "__main__":
    main()
