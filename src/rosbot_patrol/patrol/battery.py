"""Whether the battery is low: two thresholds, so that a robot at rest whose battery recovers a little stays at home."""

from __future__ import annotations

from dataclasses import dataclass

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import param
from rosbot_patrol.patrol.inputs import Battery


@dataclass(frozen=True, kw_only=True)
class BatteryParams:
    """When to go home to charge."""

    battery_low: float = param(0.2, lo=0.0, hi=1.0, doc="share of the charge below which the robot goes home")
    battery_ok: float = param(0.4, lo=0.0, hi=1.0, doc="share of the charge from which on it patrols again")
    battery_low_voltage: float = param(
        0.0, unit="V", lo=0.0, doc="the same by voltage, for a battery that does not tell its share; 0: not used"
    )
    battery_ok_voltage: float = param(0.0, unit="V", lo=0.0, doc="from here on it patrols again; 0: not used")
    battery_timeout: float = param(
        60.0, unit="s", lo=1.0, doc="a battery silent for longer is not known, and not low for that"
    )


def check_battery(params: BatteryParams, prefix: str = "") -> None:
    """Raise ParamError where the thresholds contradict each other."""
    if params.battery_ok <= params.battery_low:
        raise ParamError(
            f"{prefix}battery_ok", f"is {params.battery_ok:g}, expected more than battery_low {params.battery_low:g}"
        )
    low, ok = params.battery_low_voltage, params.battery_ok_voltage
    if (low or ok) and ok <= low:
        raise ParamError(f"{prefix}battery_ok_voltage", f"is {ok:g}, expected more than battery_low_voltage {low:g}")


class BatteryWatch:
    """Remembers whether the battery is low."""

    def __init__(self, params: BatteryParams) -> None:
        self._params = params
        self.is_low = False
        self.text = ""

    def step(self, now: float, battery: Battery | None) -> bool:
        """Look at the battery; whether `is_low` has changed.

        Args:
            now: time [s], of the clock of `battery.at`.
            battery: what it last said.
        """
        was_low = self.is_low
        if battery is None or abs(now - battery.at) > self._params.battery_timeout:
            self.is_low = False
            self.text = "the battery was low and is silent now" if was_low else ""
        else:
            self._judge(battery)
        return self.is_low != was_low

    def _judge(self, battery: Battery) -> None:
        p = self._params
        if battery.share is not None:
            value, low, ok, self.text = battery.share, p.battery_low, p.battery_ok, f"{battery.share:.0%}"
        elif battery.voltage is not None and p.battery_low_voltage:
            value, low, ok = battery.voltage, p.battery_low_voltage, p.battery_ok_voltage
            self.text = f"{battery.voltage:.1f} V"
        else:
            self.is_low, self.text = False, ""
            return
        self.is_low = value < (ok if self.is_low else low)
