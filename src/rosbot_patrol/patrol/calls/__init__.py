"""Calls of the motion sensors: filtered, queued, written down."""
