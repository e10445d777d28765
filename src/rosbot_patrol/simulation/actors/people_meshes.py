"""The parts of a human figure as triangles: limbs and trunk lofted over elliptic sections.

A section is (z, half width along x, half width along y, x of the centre), from the top of the part to its bottom, in
metres, in the frame of the part's joint.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.simulation.scene.scene import Shape
from rosbot_patrol.simulation.scene.shapes import grid_faces

Section = tuple[float, float, float, float]
_SIDES = 12


def loft(sections: Sequence[Section], *, y: float = 0.0, sides: int = _SIDES) -> Shape:
    """Make a closed body over elliptic sections, shifted sideways by `y`."""
    rows = np.array(
        [(sections[0][0], 1e-4, 1e-4, sections[0][3]), *sections, (sections[-1][0], 1e-4, 1e-4, sections[-1][3])]
    )
    cosines, sines = _circle(sides)
    points = np.empty((len(rows), sides + 1, 3))
    points[..., 0] = rows[:, 1, None] * cosines + rows[:, 3, None]
    points[..., 1] = rows[:, 2, None] * sines + y
    points[..., 2] = rows[:, 0, None]
    return Shape(kind="mesh", vertices=points.reshape(-1, 3), faces=grid_faces(len(rows), sides + 1))


@functools.lru_cache(maxsize=16)
def _circle(sides: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    return np.cos(angle), np.sin(angle)


def ellipsoid(
    x: float, y: float, z: float, *, at: tuple[float, float, float] = (0.0, 0.0, 0.0), rings: int = 8
) -> Shape:
    """An ellipsoid with the given half axes."""
    polar = np.linspace(0.08, np.pi - 0.08, rings)
    sections = [(at[2] + z * float(np.cos(p)), x * float(np.sin(p)), y * float(np.sin(p)), at[0]) for p in polar]
    return loft(sections, y=at[1])


def thigh(length: float, build: float) -> Shape:
    """Thigh, from hip to knee."""
    a, b = 0.088 * build, 0.058 * (0.6 + 0.4 * build)
    return loft(
        [
            (0.06, 0.7 * a, 0.6 * a, 0),
            (0.0, a, 0.95 * a, 0),
            (-0.35 * length, 0.92 * a, 0.85 * a, 0.01),
            (-0.85 * length, 1.08 * b, b, 0.008),
            (-length, b, 0.95 * b, 0.006),
            (-length - 0.03, 0.8 * b, 0.8 * b, 0),
        ]
    )


def shin(length: float, build: float, *, loose: float) -> Shape:
    """Shin, from knee to ankle; `loose` widens the trouser leg at the ankle."""
    a, b = 0.056 * (0.6 + 0.4 * build), 0.036 + 0.022 * loose
    return loft(
        [
            (0.03, 0.8 * a, 0.8 * a, 0),
            (0.0, a, 0.95 * a, 0.004),
            (-0.3 * length, 1.08 * a, a, -0.012),
            (-0.75 * length, max(0.75 * a, b), max(0.72 * a, b), -0.006),
            (-length, 1.05 * b, b, 0.0),
        ]
    )


def shoe(length: float, high: float) -> Shape:
    """A foot in a shoe below its ankle; `high` is the height of the shaft."""
    half = length / 2
    return loft(
        [
            (0.02 + high, 0.044, 0.042, -0.005),
            (-0.01, 0.052, 0.045, 0.0),
            (-0.035, 0.6 * half, 0.047, 0.030),
            (-0.052, 0.92 * half, 0.049, 0.055),
            (-0.075, half, 0.050, 0.058),
        ]
    )


def trunk(length: float, shoulder: float, build: float, *, loose: float) -> Shape:
    """Trunk, from waist to shoulders; its frame is at the waist."""
    w, d = shoulder, 0.105 * build
    waist = (0.70 + 0.18 * loose + 0.25 * (build - 1)) * w
    return loft(
        [
            (1.06 * length, 0.055, 0.06, -0.01),
            (1.01 * length, 0.075, 0.62 * w, -0.01),
            (0.96 * length, 0.9 * d, 0.90 * w, -0.008),
            (0.85 * length, 1.08 * d, 0.97 * w, 0.0),
            (0.65 * length, 1.12 * d, 0.92 * w, 0.012),
            (0.35 * length, d, 0.88 * waist + 0.06 * w, 0.008),
            (0.10 * length, 0.97 * d, waist, 0.004),
            (-0.10 * length, 1.02 * d, 1.02 * waist, 0.0),
        ]
    )


def hips(width: float, build: float) -> Shape:
    """The pelvis around the middle of the hip joints."""
    d = 0.105 * build
    return loft(
        [
            (0.13, 0.95 * d, 0.92 * width, 0),
            (0.05, 1.08 * d, width, -0.005),
            (-0.05, 1.05 * d, width, -0.008),
            (-0.10, 0.6 * d, 0.75 * width, 0),
        ]
    )


def skirt(width: float, length: float, build: float, *, flare: float) -> Shape:
    """A skirt, or the tail of a coat, from the waist down."""
    d = 0.12 * build
    return loft(
        [
            (0.14, 0.9 * d, 0.95 * width, 0),
            (0.0, 1.1 * d, 1.05 * width, 0),
            (-0.5 * length, d * (1.1 + 0.4 * flare), width * (1.05 + 0.25 * flare), 0),
            (-length, d * (1.15 + 0.8 * flare), width * (1.08 + 0.45 * flare), 0),
        ]
    )


def upper_arm(length: float, build: float, *, loose: float) -> Shape:
    """Upper arm, from shoulder to elbow."""
    a = 0.052 * (0.5 + 0.5 * build) + 0.012 * loose
    return loft(
        [
            (0.045, 0.5 * a, 0.5 * a, 0),
            (0.02, a, a, 0),
            (-0.4 * length, 0.92 * a, 0.9 * a, 0),
            (-length, 0.8 * a, 0.78 * a, 0),
            (-length - 0.025, 0.6 * a, 0.6 * a, 0),
        ]
    )


def forearm(length: float, build: float, *, loose: float) -> Shape:
    """Forearm, from elbow to wrist."""
    a = 0.042 * (0.5 + 0.5 * build) + 0.012 * loose
    return loft([(0.02, 0.8 * a, 0.8 * a, 0), (-0.2 * length, a, a, 0), (-length, 0.72 * a, 0.68 * a, 0)])


def hand(below: float) -> Shape:
    """A hand with its wrist `below` metres below the elbow."""
    return ellipsoid(0.045, 0.022, 0.085, at=(0.008, 0.0, -below - 0.07))


def head(size: float) -> Shape:
    """Neck, face and skull; the frame is at the base of the neck, `size` is the head's height."""
    r = size / 2
    return loft(
        [
            (0.075 + 2.0 * r, 0.30 * r, 0.26 * r, -0.05 * r),
            (0.075 + 1.88 * r, 0.62 * r, 0.52 * r, -0.04 * r),
            (0.075 + 1.55 * r, 0.86 * r, 0.68 * r, 0.0),
            (0.075 + 1.1 * r, 0.90 * r, 0.70 * r, 0.02 * r),
            (0.075 + 0.75 * r, 0.86 * r, 0.66 * r, 0.06 * r),
            (0.075 + 0.35 * r, 0.72 * r, 0.55 * r, 0.12 * r),
            (0.075 + 0.05 * r, 0.50 * r, 0.42 * r, 0.10 * r),
            (0.06, 0.055, 0.055, -0.01),
            (-0.03, 0.062, 0.065, -0.012),
        ]
    )


def hair(size: float, style: str) -> Shape:
    """Hair, hood or woollen hat on a head of that size; style short, long, hood or beanie."""
    r = size / 2
    z = 0.075
    if style == "long":
        return loft(
            [
                (z + 2.1 * r, 0.3 * r, 0.3 * r, -0.08 * r),
                (z + 1.95 * r, 0.75 * r, 0.65 * r, -0.10 * r),
                (z + 1.5 * r, 0.93 * r, 0.80 * r, -0.14 * r),
                (z + 1.0 * r, 0.82 * r, 0.86 * r, -0.30 * r),
                (z + 0.2 * r, 0.62 * r, 0.85 * r, -0.45 * r),
                (z - 0.6 * r, 0.42 * r, 0.75 * r, -0.50 * r),
            ]
        )
    if style == "hood":
        return loft(
            [
                (z + 2.2 * r, 0.3 * r, 0.3 * r, -0.08 * r),
                (z + 2.0 * r, 0.85 * r, 0.75 * r, -0.12 * r),
                (z + 1.4 * r, 1.02 * r, 0.95 * r, -0.16 * r),
                (z + 0.7 * r, 0.95 * r, 0.95 * r, -0.20 * r),
                (z - 0.1 * r, 0.85 * r, 0.95 * r, -0.10 * r),
                (z - 0.5 * r, 0.9 * r, 1.0 * r, 0.0),
            ]
        )
    low = 1.25 if style == "beanie" else 1.05
    return loft(
        [
            (z + 2.12 * r, 0.35 * r, 0.32 * r, -0.06 * r),
            (z + 1.98 * r, 0.74 * r, 0.60 * r, -0.06 * r),
            (z + 1.6 * r, 0.95 * r, 0.78 * r, -0.06 * r),
            (z + low * r, 0.90 * r, 0.77 * r, -0.13 * r),
            (z + (low - 0.3) * r, 0.66 * r, 0.70 * r, -0.33 * r),
        ]
    )


def brim(size: float) -> Shape:
    """The peak of a cap."""
    r = size / 2
    return loft([(0.075 + 1.50 * r, 0.55 * r, 0.55 * r, 0.75 * r), (0.075 + 1.42 * r, 0.72 * r, 0.62 * r, 0.82 * r)])


def backpack(height: float) -> Shape:
    """A backpack behind the trunk; the frame is at the waist."""
    return loft(
        [
            (0.95 * height, 0.04, 0.09, -0.19),
            (0.88 * height, 0.075, 0.15, -0.19),
            (0.4 * height, 0.10, 0.16, -0.20),
            (0.12 * height, 0.09, 0.15, -0.20),
        ]
    )
