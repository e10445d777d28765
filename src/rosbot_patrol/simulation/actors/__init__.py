"""Who and what moves: people, pets, doors."""
