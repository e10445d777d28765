"""Pictures as they travel: ROS encodings and compressed bytes <-> numpy arrays."""
