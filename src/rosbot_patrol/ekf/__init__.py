"""Extended Kalman filter of a robot's motion, from wheels, IMU and other sensors (robot_localization)."""
