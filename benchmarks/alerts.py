#!/usr/bin/env python3
"""Alerts and incidents: time to store, find and send them.

    benchmarks/alerts.py [--only PART ...] [--json FILE]

Parts: search (100,000 incidents: lists, searches, one record, verification), keeping (cost to the patrol), chain
(sensor to goal, person to disk and mail server, with the real nodes).
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import os
from collections.abc import Callable
from pathlib import Path

import alerts_chain
import alerts_keeping
import alerts_search

PARTS: dict[str, Callable[[], dict[str, float]]] = {
    "search": alerts_search.measure,
    "keeping": alerts_keeping.measure,
    "chain": alerts_chain.measure,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="parts to measure")
    parser.add_argument("--json", type=Path, help="write the figures here")
    arguments = parser.parse_args()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    figures: dict[str, float] = {}
    for part in arguments.only:
        figures |= PARTS[part]()
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
