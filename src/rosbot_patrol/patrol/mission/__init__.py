"""A mission: drive to a room, look around, drive home; and the manager that runs one at a time."""
