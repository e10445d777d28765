"""The belief of who is there: hypotheses in the map with evidence in log-odds."""
