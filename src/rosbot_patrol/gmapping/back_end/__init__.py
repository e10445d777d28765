"""Closing loops for good: relations between places seen again, and the graph of poses that fits them best."""
