"""Scenario files: who comes when, and what breaks."""
