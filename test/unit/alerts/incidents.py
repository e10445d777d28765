"""Fixtures of the alerts' tests, here and in test/process/alerts."""

import os
import tempfile
from pathlib import Path

import pytest

from rosbot_patrol.alerts.channels.mail import make_envelope
from rosbot_patrol.alerts.records.incident import Incident


@pytest.fixture
def make_incident():
    def make(**given):
        values = {
            "id": "20261121T010203Z-1",
            "wall": 1_790_000_000.0,
            "ros_time": 61.5,
            "room_id": 3,
            "room_name": "Küche – 台所",
            "phase": "looking",
            "object_class": "person",
            "probability": 0.87,
            "pictures": 3,
            "verdict": "confirmed",
            "reason": "person seen in room 3",
            "pose": (1.0, 2.0, 0.5),
        }
        return Incident(**{**values, **given})

    return make


@pytest.fixture
def envelope():
    return make_envelope("owner@example.org", "robot@example.org")


@pytest.fixture
def quick_disk(tmp_path):
    """A folder in memory where there is one: databases that wait for a disk at each write take seconds."""
    if not os.access("/dev/shm", os.W_OK):
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        yield Path(folder)
