"""Replays of the nodes, fed from recordings."""
