"""What a kernel may be called with."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rosbot_patrol.kernels.arguments import arrays_of, check


def test_a_signature_tells_its_arrays_from_its_numbers() -> None:
    count, arrays = arrays_of(
        "Tuple((float64[:, ::1], int64))(uint8[:,::1], int64, boolean[::1], float32[:, :, ::1], boolean)"
    )
    assert count == 5
    assert [(each.at, each.dtype.name, each.axes) for each in arrays] == [
        (0, "uint8", 2),
        (2, "bool", 1),
        (3, "float32", 3),
    ]


def test_a_kernel_may_have_no_arguments() -> None:
    assert arrays_of("void()") == (0, ())


@pytest.mark.parametrize("argument", ["float64[:]", "float64[:, :]", "optional(float64)", "List(int64)"])
def test_a_signature_that_is_not_checked_is_refused(argument: str) -> None:
    with pytest.raises(ValueError, match="is not checked"):
        arrays_of(f"void({argument})")


def test_fitting_arguments_pass() -> None:
    count, arrays = arrays_of("void(float64[:, ::1], int64)")
    check((np.zeros((2, 3)), 1), "name", count, arrays)
    check((np.zeros((0, 3)), 1), "name", count, arrays)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (np.zeros((2, 3), np.float32), "float32 with 2$"),
        (np.zeros(3), "float64 with 1$"),
        (np.zeros((2, 6))[:, ::2], "not contiguous$"),
        (np.zeros((3, 2)).T, "not contiguous$"),
        ([[0.0]], "list$"),
        (None, "NoneType$"),
    ],
)
def test_another_array_is_refused_in_a_sentence(given: Any, text: str) -> None:
    count, arrays = arrays_of("void(int64, float64[:, ::1])")
    with pytest.raises(TypeError, match="clearances takes as argument 2 float64 with 2 axes, not .*" + text):
        check((1, given), "clearances", count, arrays)


def test_a_read_only_array_is_refused() -> None:
    given = np.frombuffer(bytes(16), np.float64)
    count, arrays = arrays_of("void(float64[::1])")
    with pytest.raises(TypeError, match="read-only"):
        check((given,), "name", count, arrays)


def test_another_number_of_arguments_is_refused() -> None:
    with pytest.raises(TypeError, match="takes 2 arguments, not 1"):
        check((1,), "name", *arrays_of("void(int64, int64)"))
