"""The smallest of the houses, read once."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbot_patrol.campaign.floor import Floor
from rosbot_patrol.campaign.houses.files import House, house_files, load_house

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="session")
def flat() -> House:
    return load_house(house_files("flat", ROOT))


@pytest.fixture(scope="session")
def flat_floor(flat: House) -> Floor:
    return Floor(flat.bodies, flat.rooms)
