"""All message types that a replay can use."""

from __future__ import annotations

from rosbot_patrol.replay import patrol_records, records

KINDS: dict[str, records.Kind] = {**records.KINDS, **patrol_records.KINDS}
