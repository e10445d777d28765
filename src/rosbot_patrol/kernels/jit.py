"""numba, for the compiler of the library and for programs without one."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import numba

from rosbot_patrol.files import cache_dir

_BLAS = "scipy.linalg"


def jit(function: Any, signature: str, options: dict[str, Any]) -> Any:
    """Compile now, so that nothing compiles in mid-drive, or load from numba's cache."""
    numba.config.CACHE_DIR = str(cache_dir())
    return numba.njit([signature] if signature else None, cache=True, nogil=True, **options)(function)


def lazy(function: Any, options: dict[str, Any]) -> Any:
    """Prepare a function that compiles where another one calls it."""
    return numba.njit(nogil=True, **options)(function)


def _import_arrays() -> None:
    """Import numba's arrays without scipy's BLAS: 16 MB for products of matrices that no kernel has."""
    if _BLAS in sys.modules:
        return
    sys.modules[_BLAS] = None  # type: ignore[assignment]
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        del sys.modules[_BLAS]


_import_arrays()
