"""Mesh files: COLLADA, OBJ, STL."""
