"""Costmaps made of layers (costmap_2d)."""
