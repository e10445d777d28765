"""Notices to the owner: what they say, and the folder in which they wait."""
