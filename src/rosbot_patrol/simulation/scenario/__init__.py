"""Scenario files: the timed events of a simulation, from actors to faults."""
