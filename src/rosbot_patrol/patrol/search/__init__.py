"""The search of a room: turns, viewpoints, second looks, until enough was seen."""
