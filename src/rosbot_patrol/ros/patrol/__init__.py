"""The node patrol_robot."""
