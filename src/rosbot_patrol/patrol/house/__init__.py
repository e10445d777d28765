"""The house that is guarded: rooms, floor, known objects."""
