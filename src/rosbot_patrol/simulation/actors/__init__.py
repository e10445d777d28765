"""Moving things: people, pets, doors."""
