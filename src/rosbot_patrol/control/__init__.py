"""Between those who command the base and the base: who is heard, and what is safe."""
