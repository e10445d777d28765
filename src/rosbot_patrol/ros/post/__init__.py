"""Delivery of notices, and the programs notify and incidents."""
