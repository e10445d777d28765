"""The house's files as the owner changes them on the pages: rooms, zones, sensors, times and channels."""
