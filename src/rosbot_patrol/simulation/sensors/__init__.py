"""Simulated sensors: lidar, camera, range and motion sensors."""
