"""Adaptive Monte Carlo localisation: where on a known map the robot is, from odometry and a planar lidar."""
