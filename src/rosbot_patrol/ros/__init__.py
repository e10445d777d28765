"""ROS adapters: the only modules that import ROS."""
