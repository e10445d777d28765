"""See things in pictures: darknet networks, their files and their decoding."""
