"""Nodes of devices: drop-ins for the drivers of a real robot."""
