"""What the patrol says about itself: status, narration, the log of a mission."""
