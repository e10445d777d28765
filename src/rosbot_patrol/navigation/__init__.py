"""move_base's state machine."""
