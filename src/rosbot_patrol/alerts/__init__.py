"""Incidents: their records, and the notices to the owner."""
