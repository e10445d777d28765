"""Replay of recorded bags through the cores of the nodes, offline and repeatable."""
