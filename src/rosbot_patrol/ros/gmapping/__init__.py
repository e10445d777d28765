"""The nodes slam_gmapping and explore."""
