"""Conversion between ROS messages and records or arrays."""
