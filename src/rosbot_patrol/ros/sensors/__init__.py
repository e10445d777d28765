"""The node sensor_watch and the program sensors."""
