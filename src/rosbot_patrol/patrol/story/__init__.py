"""Texts of the patrol about itself: status, narration, mission log."""
