"""Messages into the console's records."""

from __future__ import annotations

import math

from sensor_msgs.msg import BatteryState

from rosbot_patrol.console.live.house_state import ArmingNow, BatteryNow, GuardNow, SensorNow
from rosbot_patrol.msg import Arming, PatrolState, SensorState


def guard_from_msg(message: PatrolState) -> GuardNow:
    """What the guard does."""
    return GuardNow(
        doing=message.state,
        room_id=message.room_id,
        room_name=message.room_name,
        origin=message.origin,
        why=message.why,
        queue=tuple(message.queue),
        verdict=message.verdict,
        last_verdict=message.last_verdict,
        share_seen=None if message.share_seen < 0 else round(message.share_seen, 2),
    )


def arming_from_msg(message: Arming) -> ArmingNow:
    """What is armed."""
    return ArmingNow(
        mode=message.mode,
        rooms=None if message.all_rooms else tuple(message.rooms),
        exit_delay=message.exit_delay,
        entry_delay=message.entry_delay,
        is_quiet=message.quiet,
        why=message.why,
        muted=tuple(zip(message.muted, message.muted_until, strict=True)),
    )


def sensor_from_msg(message: SensorState) -> SensorNow:
    """One motion sensor."""
    return SensorNow(
        id=message.id,
        name=message.name or message.room_name or f"sensor {message.id}",
        room_id=None if message.room < 0 else message.room,
        state=message.state,
        heard=_known(message.heard),
        motion=_known(message.motion),
        text=message.text,
    )


def battery_from_msg(message: BatteryState) -> BatteryNow:
    """The battery; tenths of a volt, so that noise draws no page anew."""
    is_charging = message.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_CHARGING
    share = round(message.percentage, 2) if math.isfinite(message.percentage) else None
    voltage = round(message.voltage, 1) if math.isfinite(message.voltage) and message.voltage > 0 else None
    return BatteryNow(share=share, voltage=voltage, is_charging=is_charging)


def _known(seconds: float) -> float | None:
    return None if seconds < 0 else round(seconds)
