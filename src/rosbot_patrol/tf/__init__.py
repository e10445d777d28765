"""Transforms between frames without ROS."""
