"""The page of the house: rooms, zones and objects on the map, motion sensors, times, ways to the owner."""
