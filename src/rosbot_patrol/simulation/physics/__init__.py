"""Physics of bodies that push and fall: PyBullet."""
