"""For all tests."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True)
def usual_umask() -> Iterator[None]:
    """A program that keeps its files private, run within a test, leaves no other test with its umask."""
    before = os.umask(0o022)
    yield
    os.umask(before)
