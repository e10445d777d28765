"""A battery of three lithium-ion cells: charge and voltage under load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rosbot_patrol.params import param

# Open-circuit voltage of a cell by its charge.
_CHARGE = (0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
_VOLTS = (3.00, 3.30, 3.45, 3.58, 3.68, 3.80, 3.97, 4.06, 4.18)


@dataclass(frozen=True, kw_only=True)
class BatteryParams:
    """Capacity of the battery, and the current that the robot draws."""

    capacity: float = param(3.5, unit="Ah", lo=0.01, doc="charge of a full battery")
    cells: int = param(3, lo=1, doc="number of cells in series")
    charge: float = param(1.0, lo=0.0, hi=1.0, doc="share of the charge at the start")
    idle_current: float = param(1.1, unit="A", lo=0.0, doc="current at rest")
    drive_current: float = param(2.0, unit="A", lo=0.0, doc="additional current at full wheel speed")
    resistance: float = param(0.09, unit="Ohm", lo=0.0, doc="internal resistance of the battery")


class Battery:
    """The battery's charge and its discharge."""

    def __init__(self, params: BatteryParams) -> None:
        self.params = params
        self.charge = params.charge
        self.current = params.idle_current

    def step(self, load: float, dt: float) -> None:
        """Discharge for `dt` [s] at a load of 0 to 1."""
        self.current = self.params.idle_current + self.params.drive_current * min(max(load, 0.0), 1.0)
        self.charge = max(self.charge - self.current * dt / 3600.0 / self.params.capacity, 0.0)

    @property
    def voltage(self) -> float:
        """Voltage under the present load [V]."""
        resting = float(np.interp(self.charge, _CHARGE, _VOLTS)) * self.params.cells
        return resting - self.current * self.params.resistance
