"""Notices and incidents on ROS: who sends them, and the programs notify and incidents."""
