"""What happens to a velocity command on its way to the wheels: priority, giving way, collision guard."""
