"""Motion and contacts of bodies: PyBullet."""
