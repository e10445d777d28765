"""Replay of recorded bags through the nodes' cores, offline and deterministic."""
