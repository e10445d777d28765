"""Cameras by USB and by network: their pictures as JPEG where they send JPEG, and their calibration."""
