"""The guard: calls, missions, the search of a room, who is an intruder, verdicts."""
