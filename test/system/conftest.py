"""One roscore for all system tests; each test launches its own house on it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def master(tmp_path_factory: pytest.TempPathFactory) -> Iterator[object]:
    house = pytest.importorskip("rosbot_patrol.ros.house", reason="the workspace is not on the path: `. scripts/env`")
    running = house.Master(tmp_path_factory.mktemp("master") / "roscore.log")
    yield running
    running.stop()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path
