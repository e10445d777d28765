"""Supervision of the ROS graph: who is in it, who drives, what has gone, and who could come in."""
