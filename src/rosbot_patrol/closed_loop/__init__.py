"""Navigation driven in a simulated world without ROS."""
