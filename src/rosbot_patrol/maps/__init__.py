"""Occupancy grids: map files, pictures of maps, distances, ways."""
