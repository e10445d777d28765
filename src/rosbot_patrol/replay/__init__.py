"""Recorded bags run through the cores of the nodes, offline and the same each time."""
