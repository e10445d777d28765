"""Gazebo's world and model files (SDF)."""
