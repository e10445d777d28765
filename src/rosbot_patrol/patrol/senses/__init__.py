"""The patrol's senses: what arrives is judged, placed and measured, and each step is told of it."""
