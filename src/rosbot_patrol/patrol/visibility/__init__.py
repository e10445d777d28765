"""What a camera can see of a floor: coverage, viewpoints, room points that are fit."""
