"""The yaml files that pages show load as they stand: each by the reader of its program."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from page_list import PAGES, ROOT

from rosbot_patrol.patrol.guard.schedule import load_schedule
from rosbot_patrol.patrol.house.rooms import Rooms, load_rooms
from rosbot_patrol.patrol.intruder.known_objects import load_known
from rosbot_patrol.replay.case import read_case
from rosbot_patrol.sensors.sensor_file import load_sensors
from rosbot_patrol.simulation.scenario.file import read_scenario

FRAGMENTS = {"docs/costmaps.md": 2}  # parts of a costmap's parameters, with `...` for the rest


def rooms(folder: Path) -> Rooms:
    """Those of our house, of which one is called as the pages' example."""
    file = folder / "rooms.yaml"
    text = (ROOT / "params" / "room_points.yaml").read_text(encoding="utf-8")
    file.write_text(re.sub(r"(room2:\s+name:) .*", r"\1 kitchen", text), encoding="utf-8")
    return load_rooms(file)


def load(text: str, folder: Path) -> object:
    (folder / "scenarios").mkdir()
    for name in ("worlds", "config"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "scenarios" / "amcl.yaml").symlink_to(ROOT / "config" / "tuned" / "amcl.yaml")  # named by a replay case
    file = folder / "scenarios" / "example.yaml"
    file.write_text(text, encoding="utf-8")
    keys = set(yaml.safe_load(text))
    if "rounds" in keys:
        return load_schedule(str(file), rooms(folder))[0]
    if "sensors" in keys:
        names = {room.id: room.name for room in rooms(folder)}
        return load_sensors(file, names, rooms_source="rooms.yaml")
    readers = {"expect": read_scenario, "objects": load_known, "bag": read_case}
    (reader,) = [readers[key] for key in keys & set(readers)]
    return reader(file)


def blocks() -> list[tuple[str, str]]:
    found = []
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        shown = re.findall(r"^```yaml\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
        assert len(shown) >= FRAGMENTS.get(page, 0)
        found += [(page, block) for block in shown[FRAGMENTS.get(page, 0) :]]
    return found


@pytest.mark.parametrize(("page", "text"), blocks(), ids=lambda value: value if "\n" not in value else "")
def test_a_file_that_a_page_shows_loads(page: str, text: str, tmp_path: Path) -> None:
    assert load(text, tmp_path)


def test_the_pages_show_files() -> None:
    assert len(blocks()) >= 5
