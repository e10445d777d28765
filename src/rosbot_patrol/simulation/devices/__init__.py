"""Emulated devices: what a real one would send on its wire, from the simulated world."""
