"""Global planners, local planners and recovery behaviours."""
