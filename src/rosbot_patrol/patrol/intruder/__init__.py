"""Whether the camera shows an intruder."""
