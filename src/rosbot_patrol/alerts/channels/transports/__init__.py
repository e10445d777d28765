"""The ways by which notices leave, one module each."""
