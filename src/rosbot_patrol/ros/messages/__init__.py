"""Conversion of ROS messages to records and arrays, and back."""
