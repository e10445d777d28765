"""Lights of a scene, and those of different times of the day by name."""

from __future__ import annotations

from dataclasses import dataclass

Vec3 = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Light:
    """Lights of a scene; their colours add up, and a sum of about 1 is full light.

    Attributes:
        sun_direction: towards the sun, of any length.
        above, below: light on faces that look up and down, interpolated between.
        lamp_place: position of a lamp [m]; its light falls to a half at `lamp_reach` [m].
        is_lamp_carried: whether the camera carries the lamp, wherever `lamp_place` is.
        sky: background colour.
    """

    sun_direction: Vec3 = (-0.55, -0.35, 0.75)
    sun: Vec3 = (0.36, 0.35, 0.33)
    above: Vec3 = (0.68, 0.69, 0.72)
    below: Vec3 = (0.44, 0.43, 0.41)
    lamp_place: Vec3 = (0.0, 0.0, 2.4)
    lamp: Vec3 = (0.0, 0.0, 0.0)
    lamp_reach: float = 4.0
    is_lamp_carried: bool = False
    sky: Vec3 = (0.72, 0.80, 0.90)


LIGHTS: dict[str, Light] = {
    "day": Light(),
    "noon": Light(sun_direction=(0.2, -0.3, 1.0), sun=(0.62, 0.60, 0.55), above=(0.78, 0.79, 0.81)),
    "evening": Light(
        sun_direction=(0.8, 0.3, 0.25),
        sun=(0.42, 0.27, 0.15),
        above=(0.36, 0.34, 0.36),
        below=(0.25, 0.23, 0.22),
        sky=(0.75, 0.52, 0.38),
    ),
    "lamps": Light(sun=(0.12, 0.10, 0.07), above=(0.50, 0.43, 0.33), below=(0.36, 0.31, 0.24), sky=(0.03, 0.03, 0.06)),
    "torch": Light(
        sun=(0.0, 0.0, 0.0),
        above=(0.12, 0.12, 0.15),
        below=(0.08, 0.08, 0.10),
        lamp=(1.0, 0.98, 0.92),
        is_lamp_carried=True,
        sky=(0.02, 0.02, 0.04),
    ),
}
"""From noon to night: in `torch` the robot carries the only lamp."""
