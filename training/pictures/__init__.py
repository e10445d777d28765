"""Pictures to learn from: rooms by chance, people in them, and which of them can be seen."""
