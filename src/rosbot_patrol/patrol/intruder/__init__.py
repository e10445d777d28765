"""What boxes and scans measure (places, sizes, legs, motion), and who was met."""
