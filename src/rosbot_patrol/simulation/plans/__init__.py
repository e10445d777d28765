"""Plans of houses, worlds made of them, and plans drawn by chance."""
