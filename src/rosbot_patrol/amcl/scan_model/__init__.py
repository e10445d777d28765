"""Sensor models: fit of a scan to the map at a pose."""
