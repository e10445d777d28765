"""Where a robot without a map drives next: frontiers of the known space."""
