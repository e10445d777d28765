import errno
import os

import pytest

from rosbot_patrol.alerts.disk_reserve import DiskReserve


@pytest.fixture
def reserve(tmp_path):
    return DiskReserve(tmp_path / "reserve", 100_000)


def test_room_is_held_given_up_in_parts_and_held_again(reserve):
    assert (reserve.held, reserve.give(10)) == (0, 0)
    reserve.fill()
    assert reserve.held == 100_000
    assert reserve.path.stat().st_blocks * 512 >= 100_000
    assert reserve.give(30_000) == 30_000
    assert reserve.held == 70_000
    assert reserve.give(10**9) == 70_000
    reserve.fill()
    assert reserve.held == 100_000


def test_a_disk_with_little_room_is_left_alone(reserve):
    reserve.fill(only_with=1 << 60)
    assert not reserve.path.exists()


@pytest.mark.parametrize("held", [0, 40_000])
def test_a_disk_that_fills_meanwhile_keeps_what_was_held(reserve, monkeypatch, held):
    if held:
        reserve.path.write_bytes(bytes(held))

    def fail(handle, offset, size):
        os.ftruncate(handle, size // 2)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", fail)
    with pytest.raises(OSError, match="No space left"):
        reserve.fill()
    assert reserve.held == held
    assert reserve.path.exists() is bool(held)


def test_a_folder_in_its_place_is_moved_aside(tmp_path):
    (tmp_path / "reserve").mkdir()
    (tmp_path / "reserve" / "x").touch()
    reserve = DiskReserve(tmp_path / "reserve", 4096)
    assert reserve.held == reserve.give(100) == 0
    reserve.fill()
    assert reserve.held == 4096
    (aside,) = tmp_path.glob("reserve-*")
    assert (aside / "x").exists()
