"""What stands in a world: bodies, shapes, lines of sight, floor plan."""
