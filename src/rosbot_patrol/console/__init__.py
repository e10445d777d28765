"""The owner's web page: what the guard does, its camera and map, what happened, and the orders of people. No ROS."""
