"""Programs for a person at the keyboard or at rviz."""
