"""Renderers of a world: OpenGL, a small software renderer, and a view from above."""
