"""Missions: rooms, driving there, looking around, when a detection is an intruder."""
