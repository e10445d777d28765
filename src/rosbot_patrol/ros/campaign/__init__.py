"""Whole houses as child processes: campaigns, system tests and benchmarks drive them."""
