"""Gazebo models and ROS packages by name."""
