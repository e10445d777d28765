"""Folders of logs of earlier runs: the oldest go until the rest is small enough."""

from __future__ import annotations

import shutil
from pathlib import Path


def prune(folder: Path, keep: int) -> list[str]:
    """Remove the oldest entries of a folder of logs; returns their names.

    Args:
        folder: of runs and files; a missing one is empty.
        keep: size that may stay [bytes].
    """
    if not folder.is_dir():
        return []
    entries = sorted(
        (each for each in folder.iterdir() if not each.is_symlink()), key=lambda each: each.stat().st_mtime
    )
    sizes = {each: _size(each) for each in entries}
    removed = []
    while entries and sum(sizes[each] for each in entries) > keep:
        oldest = entries.pop(0)
        if oldest.is_dir():
            shutil.rmtree(oldest)
        else:
            oldest.unlink()
        removed.append(oldest.name)
    return removed


def _size(path: Path) -> int:
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(each.lstat().st_size for each in files if each.is_file() and not each.is_symlink())
