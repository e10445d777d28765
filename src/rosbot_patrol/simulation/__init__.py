"""The simulated house, robot, sensors and people."""
