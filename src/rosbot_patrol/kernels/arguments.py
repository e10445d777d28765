"""Check what a kernel is called with: machine code takes any array for the one that it was compiled for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_ARGUMENT = re.compile(r"(?P<type>[a-z]+\d*)(\[(?P<axes>(:, ?)*::1)\])?")


class Declared(NamedTuple):
    """An array among the arguments."""

    at: int
    dtype: np.dtype[Any]
    axes: int


def arrays_of(signature: str) -> tuple[int, tuple[Declared, ...]]:
    """Read numba's signature, such as "void(float64[:, ::1], int64)".

    Returns:
        the number of arguments, and the arrays among them.

    Raises:
        ValueError: an argument is neither a number nor an array that is contiguous in its last axis.
    """
    arguments = re.findall(r"[^,\[\]]+(?:\[[^\]]*\])?", signature[_opening(signature) + 1 : -1])
    arrays = []
    for at, text in enumerate(arguments):
        found = _ARGUMENT.fullmatch(text.strip())
        if found is None:
            raise ValueError(f"the signature {signature!r} has an argument that is not checked: {text.strip()!r}")
        if found["axes"]:
            name = "bool" if found["type"] == "boolean" else found["type"]
            arrays.append(Declared(at, np.dtype(name), found["axes"].count(":") - 1))
    return len(arguments), tuple(arrays)


def check(args: Sequence[Any], name: str, count: int, arrays: Sequence[Declared]) -> None:
    """Compare a call's arguments with the declared ones.

    Raises:
        TypeError: another number of them, or an array of another type, with other axes, not contiguous or not writable.
    """
    if len(args) != count:
        raise TypeError(f"{name} takes {count} arguments, not {len(args)}")
    for at, dtype, axes in arrays:
        array = args[at]
        if not isinstance(array, np.ndarray) or array.dtype != dtype or array.ndim != axes or not array.flags.carray:
            raise TypeError(f"{name} takes as argument {at + 1} {dtype} with {axes} axes, not {_described(array)}")


def _opening(signature: str) -> int:
    """Index of the parenthesis that opens the arguments; a tuple among the results has parentheses of its own."""
    depth = 0
    for at in range(len(signature) - 1, -1, -1):
        depth += (signature[at] == ")") - (signature[at] == "(")
        if depth == 0:
            return at
    raise ValueError(f"no signature: {signature!r}")


def _described(array: NDArray[Any] | Any) -> str:
    if not isinstance(array, np.ndarray):
        return type(array).__name__
    flags = array.flags
    faults = [
        text for text, bad in (("not contiguous", not flags.c_contiguous), ("read-only", not flags.writeable)) if bad
    ]
    return ", ".join((f"{array.dtype} with {array.ndim}", *faults))
