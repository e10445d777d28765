"""A budget for unit tests: one that works for longer is named in the summary of warnings, unless it is marked `slow`.

It does not fail: how long the same work takes is a matter of the machine.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Generator

import pytest

BUDGET = 5.0  # [s] of CPU time of the call; the longest took 2.2 on a core that others used too


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    began = time.process_time()  # waiting for others costs none of it
    result = yield
    used = time.process_time() - began
    is_traced = sys.gettrace() is not None  # coverage and debuggers make all slower
    if used > BUDGET and not is_traced and item.get_closest_marker("slow") is None:
        text = f"{item.nodeid} took {used:.1f} s of CPU time; the budget of a unit test is {BUDGET} s"
        warnings.warn(text, stacklevel=1)
    return result
