from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from training.judging import scoring, tables

REPO = Path(__file__).parents[2]
THRESHOLDS = (0.4, 0.5, 0.8)


def label(picture: int, kind: int, distance: float) -> list[float]:
    return [picture, kind, 0.2, 0.1, 0.4, 0.9, distance, 1.0, 1.0, 9000, 100, 0, 50]


def report(path: Path, probability: float, thresholds: tuple[float, ...] = THRESHOLDS) -> Path:
    """Of two pictures: a person at 2.5 m, found as surely as that, and a hydrant at 4 m, missed; one false person."""
    box = [0.2, 0.1, 0.4, 0.9]
    found = scoring.Found(
        boxes=np.array([[0, 0, probability, *box, 0, 0], [1, 0, 0.45, *box, -1, 0]]),
        labels=np.array([label(0, 0, 2.5), label(1, 1, 4.0)]),
        hit=np.array([probability, 0.0]),
        index=np.zeros((2, 2), int),
    )
    path.write_text(json.dumps({"thresholds": [scoring.figures(found, t) for t in thresholds]}))
    return path


@pytest.fixture
def readme(tmp_path: Path) -> Path:
    target = tmp_path / "README.md"
    target.write_text((REPO / "models/README.md").read_text())
    return target


def run(monkeypatch: pytest.MonkeyPatch, readme: Path, test: Path, fresh: Path, before: Path) -> None:
    files = ["--test", str(test), "--fresh", str(fresh), "--before", str(before)]
    monkeypatch.setattr("sys.argv", ["tables", str(readme), *files])
    tables.main()


def test_both_tables_are_written_anew_and_nothing_else(
    readme: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = readme.read_text().splitlines()
    new, before = report(tmp_path / "new", 0.9), report(tmp_path / "before", 0.7)
    run(monkeypatch, readme, new, new, before)
    lines = readme.read_text().splitlines()
    assert "| **0.4** (shipped) | 1/1 = 100.00 % (20.7 to 100.0) | 1/1 = 100.00 % (20.7 to 100.0) |" in "\n".join(lines)
    assert any(
        line.startswith("| 0.8, the network before this one | 0/1 = 0.00 % (0.0 to 79.3) |") and "none there" in line
        for line in lines
    )
    assert any(line.startswith("| 0.4, 2 of a fresh seed | 1/1") for line in lines)
    rows = [line for line in lines if line.startswith("| distance 2-3 m")]
    assert rows == ["| distance 2-3 m, half of what is inside the picture seen | 1/1 = 100.00 % (20.7 to 100.0) |"]
    assert [line for line in old if not line.startswith("|")] == [line for line in lines if not line.startswith("|")]
    run(monkeypatch, readme, new, new, before)
    assert readme.read_text().splitlines() == lines


def test_the_tables_that_ship_have_the_rows_of_a_report(tmp_path: Path) -> None:
    figures = json.loads(report(tmp_path / "new", 0.9).read_text())["thresholds"]
    shipped = (REPO / "models/README.md").read_text()
    for row in tables.group_rows(figures):
        assert row[: row.index("|", 1)] in shipped


def test_what_is_wrong_with_a_file_is_said_and_nothing_is_written(
    readme: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = readme.read_text()
    new, short = report(tmp_path / "new", 0.9), report(tmp_path / "short", 0.9, (0.4,))
    with pytest.raises(SystemExit, match=r"short: nothing at a threshold of 0\.8: add it to report\.py --threshold"):
        run(monkeypatch, readme, new, new, short)
    for name, text in (("torn", '{"thresholds": [{'), ("list", "[1]"), ("other", '{"thresholds": [{"a": 1}]}')):
        (tmp_path / name).write_text(text)
        with pytest.raises(SystemExit, match=rf"{name}: not what report\.py --json writes"):
            run(monkeypatch, readme, tmp_path / name, new, new)
    with pytest.raises(SystemExit, match=r"absent: not what report\.py --json writes \(FileNotFoundError"):
        run(monkeypatch, readme, tmp_path / "absent", new, new)
    assert readme.read_text() == old
    readme.write_text("nothing\n")
    with pytest.raises(SystemExit, match="0 tables begin with"):
        run(monkeypatch, readme, new, new, new)
    assert readme.read_text() == "nothing\n"
