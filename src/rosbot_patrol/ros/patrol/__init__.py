"""The node patrol."""
