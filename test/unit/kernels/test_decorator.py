"""Kernels as the rest of the code sees them."""

from __future__ import annotations

import importlib
import threading
import time

import numpy as np
import pytest

from rosbot_patrol.files import PACKAGE, kernel_library, kernel_sources
from rosbot_patrol.kernels import kernel
from rosbot_patrol.kernels.decorator import recording
from rosbot_patrol.planning.critics.sweep_kernels import clearances

needs_library = pytest.mark.skipif(not kernel_library().exists(), reason="the set-up has not compiled these kernels")


@pytest.mark.parametrize("path", kernel_sources(), ids=lambda path: path.stem)
def test_every_module_finds_its_kernels_in_the_library(path) -> None:
    importlib.import_module(".".join(("rosbot_patrol", *path.relative_to(PACKAGE).with_suffix("").parts)))


def test_a_wrong_array_is_refused_and_not_read() -> None:
    with pytest.raises(TypeError):
        clearances(np.zeros((9, 9)), 0, 0, 9, 9, 3)


@needs_library
def test_a_kernel_without_a_signature_is_for_kernels_alone() -> None:
    @kernel()
    def inner(number: int) -> int:
        return number + 1

    with pytest.raises(TypeError, match="inner has no signature"):
        inner(1)


def test_options_belong_to_inner_kernels() -> None:
    with pytest.raises(ValueError, match="takes no options"):
        kernel("int64(int64)", fastmath=True)


def test_kernels_are_recorded_for_the_compiler() -> None:
    with recording() as kernels:

        @kernel("int64(int64)")
        def outer(number: int) -> int:
            return number + 1

        @kernel()
        def inner(number: int) -> int:
            return number + 1

    assert [(each.function.__name__, each.signature) for each in kernels] == [("outer", "int64(int64)")]


@needs_library
def test_other_threads_run_while_a_kernel_does() -> None:
    cells = np.zeros((3000, 3000), np.uint8)
    cells[0, 0] = 254
    thread = threading.Thread(target=clearances, args=(cells, 0, 0, 3000, 3000, 2000))
    thread.start()
    time.sleep(0.001)
    assert thread.is_alive(), "the main thread had to wait for the kernel's end"
    thread.join()
