"""The node move_base with its costmaps."""
