"""Occupancy grids: map files, map images, distances, path lengths."""
