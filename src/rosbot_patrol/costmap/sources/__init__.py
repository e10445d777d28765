"""What an obstacle layer sees by: scans, point clouds, depth pictures."""
