"""Low battery, by two thresholds: a robot at rest stays at home although its battery recovers a little."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import param
from rosbot_patrol.patrol.records.inputs import Battery

log = logging.getLogger(__name__)

_OTHER = 0.8  # below this share of battery_low_voltage it must be another battery: cells are cut off before


@dataclass(frozen=True, kw_only=True)
class BatteryParams:
    """Battery levels at which the robot goes home and patrols again."""

    battery_low: float = param(0.2, lo=0.0, hi=1.0, doc="share of the charge below which the robot goes home")
    battery_ok: float = param(0.4, lo=0.0, hi=1.0, doc="share of the charge at which it patrols again")
    battery_low_voltage: float = param(
        10.8,
        unit="V",
        lo=0.0,
        doc="voltage below which it goes home, if the battery reports no share (ROSbot: 3 cells); 0: not used",
    )
    battery_ok_voltage: float = param(11.4, unit="V", lo=0.0, doc="voltage at which it patrols again")
    battery_voltage_first: bool = param(
        False, doc="use the voltage even if a share is reported (TurtleBot3: its share is volts / 11.1)"
    )
    battery_timeout: float = param(
        60.0, unit="s", lo=1.0, doc="maximum age of the battery state; an older one is unknown, not low"
    )


def check_battery(params: BatteryParams, prefix: str = "") -> None:
    """Raise ParamError if the thresholds contradict each other."""
    if params.battery_ok <= params.battery_low:
        raise ParamError(
            f"{prefix}battery_ok", f"is {params.battery_ok:g}, expected more than battery_low {params.battery_low:g}"
        )
    low, ok = params.battery_low_voltage, params.battery_ok_voltage
    if low and ok <= low:
        raise ParamError(f"{prefix}battery_ok_voltage", f"is {ok:g}, expected more than battery_low_voltage {low:g}")


def battery_of(share: float, voltage: float, *, is_present: bool, is_charging: bool = False) -> Battery:
    """A battery from the fields of sensor_msgs/BatteryState.

    Args:
        share: field `percentage`; drivers without it send NaN, or 0 with `present` false.
        voltage: [V]; NaN and 0 are unknown.
        is_present: field `present`; drivers that leave it false may still send a share.
        is_charging: whether it is being charged.
    """
    is_known = 0.0 <= share <= 1.0 and (share > 0.0 or is_present)
    return Battery(
        share=float(share) if is_known else None,
        voltage=float(voltage) if math.isfinite(voltage) and voltage > 0.0 else None,
        is_charging=is_charging,
    )


class BatteryWatch:
    """Decides whether the battery is low."""

    def __init__(self, params: BatteryParams) -> None:
        self._params = params
        self._has_warned = False
        self.is_low = False
        self.text = ""

    def step(self, now: float, battery: Battery | None) -> bool:
        """Evaluate the battery; returns whether `is_low` has changed.

        Args:
            now: steady time [s], as `battery.at`.
            battery: its last state.
        """
        was_low = self.is_low
        if battery is None or now - battery.at > self._params.battery_timeout:
            self.is_low = False
            self.text = "the battery was low and is silent now" if was_low else ""
        else:
            self._evaluate(battery)
        return self.is_low != was_low

    def _evaluate(self, battery: Battery) -> None:
        p = self._params
        has_voltage = battery.voltage is not None and p.battery_low_voltage > 0.0
        if battery.share is not None and not (has_voltage and p.battery_voltage_first):
            self.text = f"{battery.share:.0%}"
            self._compare(battery.share, p.battery_low, p.battery_ok)
        elif battery.voltage is not None and has_voltage:
            self._evaluate_voltage(battery.voltage)
        else:
            self.is_low, self.text = False, ""

    def _evaluate_voltage(self, voltage: float) -> None:
        p = self._params
        self.text = f"{voltage:.1f} V"
        if voltage >= _OTHER * p.battery_low_voltage:
            self._compare(voltage, p.battery_low_voltage, p.battery_ok_voltage)
        elif not self._has_warned:
            self._has_warned = True
            log.warning(
                "the battery says %.1f V, and battery_low_voltage is %.1f V: not judged, as this must be another "
                "battery; set battery_low_voltage and battery_ok_voltage for it, or 0 for none",
                voltage,
                p.battery_low_voltage,
            )

    def _compare(self, value: float, low: float, ok: float) -> None:
        self.is_low = value < (ok if self.is_low else low)
