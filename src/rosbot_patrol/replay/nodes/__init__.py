"""Nodes fed from recordings."""
