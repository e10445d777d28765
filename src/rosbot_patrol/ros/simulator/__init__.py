"""The node simulator, and the programs around it."""
