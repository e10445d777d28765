"""Bodies that push and fall: PyBullet."""
