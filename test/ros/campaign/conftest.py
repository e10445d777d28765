"""A scheduler's machines for a test, and their end."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from dask_machines import Machines


@pytest.fixture
def machines(tmp_path: Path) -> Iterator[Machines]:
    found = Machines(tmp_path)
    yield found
    found.close()
