"""Slamtec's RPLIDAR: from the bytes on its wire to the turns of its laser."""
