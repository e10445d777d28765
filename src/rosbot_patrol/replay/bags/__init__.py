"""Recordings: bag files and CARMEN logs as records."""
