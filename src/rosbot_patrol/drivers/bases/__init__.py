"""Bases on wheels: odometry from the wheels' encoders, and what a base's own driver leaves out."""
