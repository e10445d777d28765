"""Pictures of a world: OpenGL, a small software renderer, and from above."""
