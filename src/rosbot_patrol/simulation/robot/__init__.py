"""The simulated robot: URDF, wheels, odometry, battery, IMU."""
