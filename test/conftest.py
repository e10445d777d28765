"""For all tests."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from hypothesis import settings

settings.register_profile("quick", max_examples=20, deadline=None, derandomize=True)  # the same each time
settings.register_profile("long", max_examples=200, deadline=None, print_blob=True)  # `scripts/test --long`
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))


@pytest.fixture(autouse=True)
def usual_umask() -> Iterator[None]:
    """A program that keeps its files private, run within a test, leaves no other test with its umask."""
    before = os.umask(0o022)
    yield
    os.umask(before)
