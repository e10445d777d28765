"""The node simulator and its companion programs."""
