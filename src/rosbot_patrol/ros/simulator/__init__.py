"""The node simulator, and what is asked of it while it runs."""
