"""Results of a replay: tables, comparison with stored ones, plots."""
