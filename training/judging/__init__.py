"""How good a network is: test pictures, scores and the report."""
