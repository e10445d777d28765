"""Decorator of all numba kernels; their machine code is kept in `files.cache_dir()`.

`python -m rosbot_patrol.kernels` compiles everything (the set-up does it); after that a node only loads at its start.
"""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable
from typing import Any, TypeVar

import numba

from rosbot_patrol.files import PACKAGE, cache_dir, kernel_sources

F = TypeVar("F", bound=Callable[..., Any])

_BLAS = "scipy.linalg"


def _import_arrays() -> None:
    """Import numba's arrays without scipy's BLAS: 16 MB in each node, for products of matrices that no kernel has."""
    if _BLAS in sys.modules:
        return
    sys.modules[_BLAS] = None  # type: ignore[assignment]
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        del sys.modules[_BLAS]


_import_arrays()


def kernel(*signatures: str, **options: Any) -> Callable[[F], F]:
    """Compile a function with the given explicit numba signatures: cached, without the GIL, in no object mode.

    With signatures the code is compiled (or loaded from the cache) when its module is imported, so nothing compiles
    in mid-drive. Arguments that fit no signature raise TypeError at the call: pass contiguous arrays of the declared
    types. `NUMBA_DISABLE_JIT=1` leaves the plain Python function.

    Args:
        signatures: numba type strings such as "float64[::1](float64[:, ::1], int64)".
        options: further options of `numba.njit` (fastmath, inline, parallel is not allowed here).
    """
    numba.config.CACHE_DIR = str(cache_dir())

    def decorate(function: F) -> F:
        compiled: F = numba.njit(list(signatures) or None, cache=True, nogil=True, **options)(function)
        return compiled

    return decorate


def warm(say: Callable[[str], None] = print) -> float:
    """Import every kernel module, so that all is compiled and cached; returns the time taken [s]."""
    start = time.perf_counter()
    sources = kernel_sources()
    for i, path in enumerate(sources, 1):
        dotted = ".".join(("rosbot_patrol", *path.relative_to(PACKAGE).with_suffix("").parts))
        before = time.perf_counter()
        importlib.import_module(dotted)
        say(f"  [{i}/{len(sources)}] {dotted}: {time.perf_counter() - before:.1f} s")
    return time.perf_counter() - start


if __name__ == "__main__":
    seconds = warm()
    sys.stdout.write(f"kernels ready in {seconds:.1f} s, cached in {cache_dir()}\n")
