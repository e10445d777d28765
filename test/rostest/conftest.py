"""A master of its own for each module, and nodes that end with each test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from ros_processes import Ros


@pytest.fixture(scope="module")
def master() -> Iterator[Ros]:
    ros = Ros()
    yield ros
    ros.stop()


@pytest.fixture
def ros(master: Ros) -> Iterator[Ros]:
    yield master
    master.stop_nodes()
