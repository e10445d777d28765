"""How much of a room has been seen, and from where more of it can be."""
