"""Contents of a world: bodies, shapes, lines of sight, floor plan."""
