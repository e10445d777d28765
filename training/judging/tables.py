"""The tables of models/README.md, written anew from what `report.py --json` wrote of a network and of the one before.

    python -m training.judging.tables models/README.md --test FILE --fresh FILE --before FILE

Only rows of the two tables change (by threshold; by distance, visibility and light), not the sentences about them.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from training.judging.scoring import AIMED, share

BY_THRESHOLD = "| threshold | persons 1 to 6 m, half of the figure seen |"
BY_GROUP = "| persons, threshold 0.4 | found |"
SHIPPED, SURE = 0.4, 0.8
Figures = dict[str, float]


def threshold_rows(test: list[Figures], fresh: list[Figures], before: list[Figures]) -> list[str]:
    """Rows by threshold: each of the test pictures, then the fresh ones and the network before for comparison."""
    rows = [
        _row(f"**{f['threshold']:g}** (shipped)" if f["threshold"] == SHIPPED else f"{f['threshold']:g}", f)
        for f in test
    ]
    fresh_one = _at(fresh, SHIPPED)
    rows.append(_row(f"{SHIPPED:g}, {fresh_one['pictures']:.0f} of a fresh seed", fresh_one))
    return rows + [_row(f"{t:g}, the network before this one", _at(before, t)) for t in (SHIPPED, SURE)]


def group_rows(test: list[Figures]) -> list[str]:
    """Rows by distance, by visibility and by light, at the threshold that ships."""
    figures = _at(test, SHIPPED)
    names = [
        name.removesuffix(": there")
        for name in figures
        if name.startswith(("distance", "1-6 m")) and name.endswith(": there")
    ]
    return [f"| {name} | {_found(figures, name)} |" for name in names]


def replace_rows(text: str, header: str, rows: list[str]) -> str:
    """The text with other rows in the table whose head begins so.

    Raises:
        ValueError: there is no such table.
    """
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if line.startswith(header)]
    if len(heads) != 1:
        raise ValueError(f"{len(heads)} tables begin with '{header}', not one")
    first = last = heads[0] + 2
    while last < len(lines) and lines[last].startswith("|"):
        last += 1
    return "\n".join([*lines[:first], *rows, *lines[last:]]) + "\n"


def read_report(file: Path, *thresholds: float) -> list[Figures]:
    """The figures of a report, by threshold.

    Raises:
        ValueError: it is no report, or lacks one of those thresholds.
    """
    try:
        report = json.loads(file.read_text())["thresholds"]
        held = [figures["threshold"] for figures in report]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{file}: not what report.py --json writes ({type(error).__name__}: {error})") from error
    lacking = [f"{t:g}" for t in thresholds if t not in held]
    if lacking:
        raise ValueError(f"{file}: nothing at a threshold of {', '.join(lacking)}: add it to report.py --threshold")
    return list(report)


def _at(report: list[Figures], threshold: float) -> Figures:
    return next(figures for figures in report if figures["threshold"] == threshold)


def _row(name: str, figures: Figures) -> str:
    cells = [
        _found(figures, AIMED),
        _found(figures, "persons 1-6 m, half of what is inside the picture seen"),
        _precision(figures, "person"),
        _found(figures, "fire hydrants 1-6 m, half seen"),
        _precision(figures, "fire hydrant"),
    ]
    return f"| {name} | " + " | ".join(cells) + " |"


def _found(figures: Figures, name: str) -> str:
    return _share(figures[f"{name}: found"], figures[f"{name}: there"])


def _precision(figures: Figures, kind: str) -> str:
    boxes = figures[f"{kind}: boxes"]
    return _share(boxes - figures[f"{kind}: false"], boxes)


def _share(hits: float, count: float) -> str:
    return share(hits, count).replace("95 %: ", "")


def main() -> None:
    """Write them from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("readme", type=Path)
    for name, what in (
        ("test", "the test pictures"),
        ("fresh", "the fresh ones"),
        ("before", "the test pictures by the network before"),
    ):
        parser.add_argument(f"--{name}", type=Path, required=True, help=f"report of {what}")
    options = parser.parse_args()
    try:
        test, fresh = read_report(options.test, SHIPPED), read_report(options.fresh, SHIPPED)
        before = read_report(options.before, SHIPPED, SURE)
        text = replace_rows(options.readme.read_text(), BY_THRESHOLD, threshold_rows(test, fresh, before))
        text = replace_rows(text, BY_GROUP, group_rows(test))
    except (OSError, ValueError) as error:
        sys.exit(f"tables: {error}; {options.readme} is as it was")
    options.readme.write_text(text)


if __name__ == "__main__":
    main()
