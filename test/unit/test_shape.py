"""How large the parts of the house may be."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src"
FILES = sorted(SOURCE.rglob("*.py"))
MOST_FILES, MOST_LINES = 16, 400


def test_no_folder_holds_more_files_than_one_can_overlook() -> None:
    counts = Counter(path.parent.relative_to(SOURCE) for path in FILES)
    assert len(counts) > 50
    assert {str(folder): count for folder, count in counts.items() if count > MOST_FILES} == {}


def test_no_file_is_longer_than_one_reads_at_once() -> None:
    """Kernels may be: numba sees no further than their file."""
    lines = {path: len(path.read_text("utf-8").splitlines()) for path in FILES if not path.stem.endswith("_kernels")}
    assert {str(path.relative_to(SOURCE)): count for path, count in lines.items() if count > MOST_LINES} == {}
