"""Checks of a velocity command on its way to the wheels: priority, giving way, collision guard."""
