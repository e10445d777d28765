"""Actors of the simulation: people, pets, doors."""
