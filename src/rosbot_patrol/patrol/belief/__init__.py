"""The belief of who is there: hypotheses in the map with evidence in log-odds. Not wired into the patrol yet."""
