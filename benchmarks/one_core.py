"""Common parts of the single benchmarks: their arguments, one core, and the figures as JSON."""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable
from pathlib import Path


def run(doc: str | None, measure: Callable[[bool], dict[str, float]]) -> None:
    """Read the arguments, measure on one core (`measure` takes whether few repeats suffice), and write the figures."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--quick", action="store_true", help="few repeats")
    wanted = parser.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    print(f"1 core of {os.cpu_count()}")
    found = measure(wanted.quick)
    if wanted.json:
        wanted.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
