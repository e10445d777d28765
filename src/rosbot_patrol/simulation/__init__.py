"""Simulation of the house, the robot, its sensors and people."""
