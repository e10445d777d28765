"""The sheet of people, pets and doors can be drawn anew."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2

SCRIPT = Path(__file__).parents[3] / "scripts" / "draw_actors"


def draw(file: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, str(SCRIPT), "--output", str(file)], capture_output=True, text=True)


def test_the_sheet_shows_all_and_is_no_larger_than_a_page_bears(tmp_path: Path) -> None:
    done = draw(tmp_path / "sheet.png")
    assert done.returncode == 0, done.stderr
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    assert sheet.shape == (672, 840, 3)
    assert sheet.std() > 30.0
    assert (tmp_path / "sheet.png").stat().st_size < 300_000


def test_a_file_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    done = draw(tmp_path / "nowhere" / "sheet.png")
    assert done.returncode == 1
    assert done.stderr.strip().endswith("sheet.png: cannot be written")
