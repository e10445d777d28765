"""Recorded data fed through the same objects that run on the robot."""
