"""The owner's copies of files that come with the program."""

from __future__ import annotations

from pathlib import Path

from rosbot_patrol.package_files import package_file
from rosbot_patrol.patrol.house.own_files import own_file, place_to_write


def test_a_given_file_counts_and_is_changed_where_it_is(tmp_path: Path) -> None:
    given = tmp_path / "my_rooms.yaml"
    assert own_file(str(given), tmp_path, "rooms.yaml") == str(given)
    assert place_to_write(str(given), tmp_path, "rooms.yaml") == given


def test_a_shipped_file_counts_until_there_is_a_copy(tmp_path: Path) -> None:
    shipped = str(package_file("params/room_points.yaml"))
    copy = tmp_path / "house" / "room_points.yaml"
    assert own_file(shipped, tmp_path, "rooms.yaml") == shipped
    assert place_to_write(shipped, tmp_path, "rooms.yaml") == copy
    copy.parent.mkdir()
    copy.write_text("")
    assert own_file(shipped, tmp_path, "rooms.yaml") == str(copy)


def test_where_none_was_given_there_may_be_one_of_the_owner(tmp_path: Path) -> None:
    copy = tmp_path / "house" / "sensors.yaml"
    for none in ("", "none"):
        assert own_file(none, tmp_path, "sensors.yaml") == ""
        assert place_to_write(none, tmp_path, "sensors.yaml") == copy
    copy.parent.mkdir()
    copy.write_text("")
    assert own_file("", tmp_path, "sensors.yaml") == str(copy)
