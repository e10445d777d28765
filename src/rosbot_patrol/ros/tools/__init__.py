"""Programs for a person at the keyboard or in rviz."""
