"""Whether the battery is low, empty, or being charged.

Low by two thresholds: a robot at rest stays at home although its battery recovers a little. A voltage sags while the
motors draw current, so its median over some seconds counts. A charger that the driver does not report shows itself by
the voltage. At rest, once the battery has recovered from the drive, nothing else makes the voltage rise.
"""

from __future__ import annotations

import logging
import math
import statistics
from collections import deque
from dataclasses import dataclass

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import param
from rosbot_patrol.patrol.records.inputs import Battery

log = logging.getLogger(__name__)

_EMPTY = 0.95  # of battery_low_voltage
_RECOVERY = 30.0  # [s] at rest after which the voltage no longer rises by itself
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
    battery_empty: float = param(
        0.08,
        lo=0.0,
        hi=1.0,
        doc="share below which it leaves even somebody in view; of voltages 0.95 x low",
    )
    battery_window: float = param(5.0, unit="s", lo=0.0, doc="time over which the median of the voltage is taken")
    charging_rise: float = param(
        0.15, unit="V", lo=0.01, doc="rise of the voltage at rest that shows a charger which the driver does not report"
    )
    charging_wait: float = param(
        300.0,
        unit="s",
        lo=0.0,
        doc="time at home with a low battery before the owner gets a notice of the missing charger",
    )
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
    """Decides whether the battery is low, empty or being charged.

    Attributes:
        is_low: the robot has to wait at home; is_empty: it has to leave everything at once.
        is_charging: the driver says so, or the voltage shows it.
        text: charge or voltage, "" if unknown.
    """

    def __init__(self, params: BatteryParams) -> None:
        self._params = params
        self._has_warned = False
        self._voltages: deque[tuple[float, float]] = deque()
        self._rest = _RestingVoltage(params.charging_rise)
        self.is_low = self.is_empty = self.is_charging = False
        self.text = ""

    def step(self, now: float, battery: Battery | None, *, at_rest: bool = False) -> bool:
        """Evaluate the battery; returns whether `is_low` has changed.

        Args:
            now: steady time [s], as `battery.at`.
            battery: its last state.
            at_rest: the robot neither drives nor turns.
        """
        was_low = self.is_low
        if battery is None or now - battery.at > self._params.battery_timeout:
            self.is_low = self.is_empty = self.is_charging = False
            self._voltages.clear()
            self.text = "the battery was low and is silent now" if was_low else ""
        else:
            voltage = self._median(battery)
            self._evaluate(battery.share, voltage)
            by_voltage = self._rest.step(now, voltage, at_rest=at_rest)
            self.is_charging = battery.is_charging or by_voltage
        return self.is_low != was_low

    def _median(self, battery: Battery) -> float | None:
        if battery.voltage is None:
            return None
        kept = self._voltages
        if not kept or kept[-1][0] != battery.at:
            kept.append((battery.at, battery.voltage))
        while kept[0][0] < battery.at - self._params.battery_window:
            kept.popleft()
        return statistics.median(volts for _, volts in kept)

    def _evaluate(self, share: float | None, voltage: float | None) -> None:
        p = self._params
        has_voltage = voltage is not None and p.battery_low_voltage > 0.0
        if share is not None and not (has_voltage and p.battery_voltage_first):
            self.text = f"{share:.0%}"
            self._compare(share, p.battery_low, p.battery_ok, p.battery_empty)
        elif voltage is not None and has_voltage:
            self._evaluate_voltage(voltage)
        else:
            self.is_low, self.is_empty, self.text = False, False, ""

    def _evaluate_voltage(self, voltage: float) -> None:
        p = self._params
        self.text = f"{voltage:.1f} V"
        if voltage >= _OTHER * p.battery_low_voltage:
            self._compare(voltage, p.battery_low_voltage, p.battery_ok_voltage, _EMPTY * p.battery_low_voltage)
        elif not self._has_warned:
            self._has_warned = True
            log.warning(
                "the battery says %.1f V, and battery_low_voltage is %.1f V: not judged, as this must be another "
                "battery; set battery_low_voltage and battery_ok_voltage for it, or 0 for none",
                voltage,
                p.battery_low_voltage,
            )

    def _compare(self, value: float, low: float, ok: float, empty: float) -> None:
        self.is_low = value < (ok if self.is_low else low)
        self.is_empty = value < empty


class _RestingVoltage:
    """Sees a charger by the voltage of a robot at rest."""

    def __init__(self, rise: float) -> None:
        self._rise = rise
        self._since: float | None = None  # at rest
        self._lowest, self._highest = math.inf, -math.inf
        self._is_charging = False

    def step(self, now: float, voltage: float | None, *, at_rest: bool) -> bool:
        """Whether a charger is there."""
        if voltage is None or not at_rest:
            self._since, self._is_charging = None, False
            self._lowest, self._highest = math.inf, -math.inf
            return False
        self._since = now if self._since is None else self._since
        if now - self._since < _RECOVERY:
            return False
        if self._is_charging:
            self._highest = max(self._highest, voltage)
            if voltage <= self._highest - self._rise:
                self._is_charging, self._lowest = False, voltage
        else:
            self._lowest = min(self._lowest, voltage)
            if voltage >= self._lowest + self._rise:
                self._is_charging, self._highest = True, voltage
        return self._is_charging
