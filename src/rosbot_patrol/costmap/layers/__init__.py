"""Layers of a costmap: static, obstacle, range sensor, keepout, inflation."""
