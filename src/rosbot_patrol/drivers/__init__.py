"""Drivers of devices: bytes of a device in, measurements out."""
