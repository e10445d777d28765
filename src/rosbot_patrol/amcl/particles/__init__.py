"""The particle filter: moved by odometry, weighed, drawn anew."""
