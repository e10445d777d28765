"""The lidar LDS-01 of the TurtleBot3: from the bytes on its wire to its turns."""
