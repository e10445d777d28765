"""The edge to ROS: the only modules that know it."""
