"""Decorator of all numba kernels, and the cache folder of their machine code.

numba's `cache=True` does not notice changes of a callee in another module, and cannot write to a read-only install.
Therefore the name of the cache folder contains a hash of all kernel sources; it lies in `cache_folder()`.
`python -m rosbot_patrol.kernels` compiles everything (the set-up does it); after that a node only loads at its start.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

from rosbot_patrol.files import cache_folder

F = TypeVar("F", bound=Callable[..., Any])

_SOURCE = Path(__file__).resolve().parent


def kernel_sources() -> list[Path]:
    """Files with kernels, sorted: every `*_kernels.py` below this package."""
    return sorted(_SOURCE.rglob("*_kernels.py"))


@functools.lru_cache(maxsize=1)
def cache_dir() -> Path:
    """Folder of the compiled kernels for these sources and this numba version."""
    digest = hashlib.sha256(numba.__version__.encode())
    for path in kernel_sources():
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return cache_folder() / f"numba-{digest.hexdigest()[:16]}"


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
        dotted = ".".join(("rosbot_patrol", *path.relative_to(_SOURCE).with_suffix("").parts))
        before = time.perf_counter()
        importlib.import_module(dotted)
        say(f"  [{i}/{len(sources)}] {dotted}: {time.perf_counter() - before:.1f} s")
    return time.perf_counter() - start


if __name__ == "__main__":
    seconds = warm()
    sys.stdout.write(f"kernels ready in {seconds:.1f} s, cached in {cache_dir()}\n")
