"""Visibility of floor from places: coverage, viewpoints, suitable room points."""
