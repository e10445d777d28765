"""Maps: files, pictures, occupancy."""
