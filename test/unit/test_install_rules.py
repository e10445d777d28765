"""What the packages install is there in a fresh clone: a folder that is only on somebody's disk breaks `install`."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = sorted(file.parent for file in (ROOT / "drop_in").glob("*/CMakeLists.txt"))


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.name)
def test_installed_folders_hold_files(package: Path) -> None:
    rules = re.findall(r"install\(DIRECTORY ([^$)]*?) DESTINATION", (package / "CMakeLists.txt").read_text("utf-8"))
    for folder in " ".join(rules).split():
        assert any((package / folder).rglob("*.*")), f"{package.name} installs '{folder}', which holds no file"
