"""Recordings as records: bag files and CARMEN logs."""
