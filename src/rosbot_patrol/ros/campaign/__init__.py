"""Whole houses as child processes, for campaigns, system tests and benchmarks."""
