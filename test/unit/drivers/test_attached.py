"""Devices by their USB numbers, as the kernel lists them."""

from __future__ import annotations

from pathlib import Path

from rosbot_patrol.drivers.attached import BASE, LIDAR, RULES, find_attached, report


def plug_in(sysfs: Path, name: str, vendor: str, product: str, *, deep: bool) -> None:
    usb = sysfs / "devices" / f"usb-{name}"
    port = usb / "1.0" / name if deep else usb / "1.0"  # ttyUSB has a folder of its own, ttyACM none
    port.mkdir(parents=True)
    (usb / "idVendor").write_text(f"{vendor}\n")
    (usb / "idProduct").write_text(f"{product}\n")
    entry = sysfs / "class" / "tty" / name
    entry.mkdir(parents=True)
    (entry / "device").symlink_to(port)


def test_lidar_and_base_are_told_by_their_numbers(tmp_path: Path) -> None:
    plug_in(tmp_path, "ttyUSB0", "10c4", "ea60", deep=True)
    plug_in(tmp_path, "ttyACM0", "0483", "5740", deep=False)
    plug_in(tmp_path, "ttyUSB1", "dead", "beef", deep=True)
    found = find_attached({"SYSFS_PATH": str(tmp_path)})
    assert [(each.kind, str(each.path)) for each in found] == [(BASE, "/dev/ttyACM0"), (LIDAR, "/dev/ttyUSB0")]
    text = report(found)
    assert "lidar   /dev/ttyUSB0: an RPLIDAR or an LDS-01, behind a CP210x (10c4:ea60)" in text
    assert "camera  none is found: plug it in, or give a network camera's address (camera_url:=...)" in text


def test_without_devices_each_is_named_with_what_to_do(tmp_path: Path) -> None:
    text = report(find_attached({"SYSFS_PATH": str(tmp_path), "ROSBOT_VER": "ROSBOT_9"}))
    assert [line.split()[0] for line in text.splitlines()] == ["lidar", "base", "camera"]


def test_the_rules_name_what_the_table_knows() -> None:
    assert RULES.count("SYMLINK+=") == 2
    assert 'ATTRS{idVendor}=="10c4", ATTRS{idProduct}=="ea60"' in RULES
