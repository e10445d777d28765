"""Particle filter: moves particles by odometry, weighs and resamples them."""
