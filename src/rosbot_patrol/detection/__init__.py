"""Detectors of people and objects in images."""
