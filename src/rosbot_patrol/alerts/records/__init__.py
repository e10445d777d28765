"""Incident records on disk: written, chained, found, repaired, kept for a time."""
