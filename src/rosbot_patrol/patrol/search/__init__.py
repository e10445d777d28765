"""Where in a room to look from, and how much of it has been seen."""
