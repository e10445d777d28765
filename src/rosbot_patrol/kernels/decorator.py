"""The decorator of all kernels: machine code from the library, or from numba where there is no library."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

from rosbot_patrol.files import kernel_library
from rosbot_patrol.kernels.arguments import arrays_of, check

F = TypeVar("F", bound=Callable[..., Any])
LIBRARY = "kernels"  # its name as a Python module

log = logging.getLogger(__name__)


class Recorded(NamedTuple):
    """A kernel that is to be in the library."""

    function: Callable[..., Any]
    signature: str


_recorded: list[Recorded] | None = None


def kernel(signature: str = "", **options: Any) -> Callable[[F], F]:
    """Run a function as machine code, without the interpreter's lock.

    The arguments are checked at each call: an array has to be contiguous, writable and of the type that the signature
    declares. `NUMBA_DISABLE_JIT=1` leaves the plain Python function.

    Args:
        signature: numba's, such as "float64[::1](float64[:, ::1], int64)". Without one, only other kernels can call the
            function, and a call from elsewhere raises TypeError.
        options: further options of `numba.njit` (fastmath, inline), for a kernel without a signature.

    Raises:
        ValueError: options with a signature, which the library's compiler does not take; or one that is not understood.
    """
    if signature and options:
        raise ValueError(f"a kernel with the signature {signature!r} takes no options: give them to one that it calls")

    def decorate(function: Any) -> Any:
        if os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"}:
            return function
        if _recorded is not None:
            return _record(function, signature, options)
        library = _load()
        if library is None:
            return importlib.import_module("rosbot_patrol.kernels.jit").jit(function, signature, options)
        return _native(library, function, signature)

    return decorate


@contextmanager
def recording() -> Iterator[list[Recorded]]:
    """Collect the kernels of the modules imported meanwhile, instead of compiling them."""
    global _recorded
    _recorded = []
    try:
        yield _recorded
    finally:
        _recorded = None


def symbol(function: Callable[..., Any]) -> str:
    """Name of a kernel in the library: its module's and its own."""
    return f"{function.__module__}.{function.__name__}".replace(".", "__")


def _record(function: Any, signature: str, options: dict[str, Any]) -> Any:
    assert _recorded is not None
    if signature:
        _recorded.append(Recorded(function, signature))
    return importlib.import_module("rosbot_patrol.kernels.jit").lazy(function, options)


@functools.lru_cache(maxsize=1)
def _load() -> ModuleType | None:
    """Load the library; returns None if none was compiled for these sources and this processor."""
    path = kernel_library()
    spec = importlib.util.spec_from_file_location(LIBRARY, path)
    if not path.exists() or spec is None or spec.loader is None:
        log.warning(
            "There are no compiled kernels at %s: this program compiles those that it needs, which takes up to a minute"
            " the first time and 115 MB of memory each time. `scripts/bootstrap` compiles them for all programs.",
            path,
        )
        return None
    library = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(library)
    return library


def _native(library: ModuleType, function: Any, signature: str) -> Any:
    if not signature:

        @functools.wraps(function)
        def refuse(*_: Any) -> None:
            raise TypeError(f"{function.__name__} has no signature: only other kernels can call it")

        return refuse
    native = getattr(library, symbol(function))
    count, arrays = arrays_of(signature)
    name = function.__name__

    @functools.wraps(function)
    def call(*args: Any) -> Any:
        check(args, name, count, arrays)
        return native(*args)

    return call
