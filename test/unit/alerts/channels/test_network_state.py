"""A network that changed is told from one that is only used."""

from __future__ import annotations

from pathlib import Path

import pytest

from rosbot_patrol.alerts.channels import network_state
from rosbot_patrol.alerts.channels.network_state import network_mark

ROUTE = (
    "Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT\n"
    "wlan0\t00000000\t0102A8C0\t0003\t0\t0\t600\t00000000\t0\t0\t0\n"
)
ROUTE6 = (
    "fe800000000000000000000000000000 40 00000000000000000000000000000000 00 00000000000000000000000000000000 "
    "00000100 00000001 00000000 00000001    wlan0\n"
)
SERVERS = "nameserver 192.168.2.1\n"


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Path]:
    paths = {name: tmp_path / name for name in ("route", "ipv6_route", "resolv.conf")}
    for path, text in zip(paths.values(), (ROUTE, ROUTE6, SERVERS), strict=True):
        path.write_text(text)
    monkeypatch.setattr(network_state, "_SOURCES", tuple(map(str, paths.values())))
    return paths


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("route", "0102A8C0", "FE02A8C0"),  # another gateway
        ("route", "wlan0", "eth0"),
        ("route", "\t600\t", "\t100\t"),  # another metric
        ("ipv6_route", "fe800000000000000000000000000000", "20010db8000000000000000000000000"),
        ("resolv.conf", "192.168.2.1", "9.9.9.9"),
    ],
)
def test_another_route_or_name_server_is_another_mark(files: dict[str, Path], name: str, before: str, after: str):
    mark = network_mark()
    text = files[name].read_text()
    assert before in text
    files[name].write_text(text.replace(before, after))
    assert network_mark() != mark


def test_a_file_that_comes_or_goes_is_another_mark(files: dict[str, Path]) -> None:
    marks = [network_mark()]
    for path in files.values():
        path.unlink()
        marks.append(network_mark())
    assert len(set(marks)) == 4


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("route", "0003\t0\t0\t600", "0003\t7\t99\t600"),
        ("ipv6_route", "00000001 00000000 00000001", "00000004 0000ffff 00000001"),
    ],
)
def test_use_alone_is_no_change(files: dict[str, Path], name: str, before: str, after: str) -> None:
    mark = network_mark()
    text = files[name].read_text()
    assert before in text
    files[name].write_text(text.replace(before, after))
    assert network_mark() == mark


def test_this_machines_mark_stays() -> None:
    assert network_mark() == network_mark()
