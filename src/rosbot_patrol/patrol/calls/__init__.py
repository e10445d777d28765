"""Calls of the motion sensors: filtered, queued, kept on disk."""
