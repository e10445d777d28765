"""Detectors: what they find in a picture."""
