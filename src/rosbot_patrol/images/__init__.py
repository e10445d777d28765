"""Encodings of pictures: ROS messages and compressed bytes to numpy arrays and back."""
