"""A guard robot for a home or office, on ROS 1, in Python."""
