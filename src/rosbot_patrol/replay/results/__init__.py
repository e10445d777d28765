"""Results of a replay: tables, comparison with stored results, plots."""
