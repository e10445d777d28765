"""Scenario files: people's comings and goings, and faults."""
