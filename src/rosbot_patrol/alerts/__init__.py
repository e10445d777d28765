"""Incidents, and what the owner is told about them."""
