"""Closed loop: the navigation drives a simulated robot, without ROS."""
