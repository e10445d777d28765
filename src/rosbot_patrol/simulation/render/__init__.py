"""Rendering of pictures: OpenGL, a small software renderer, and a view from above."""
