from __future__ import annotations

import logging
from dataclasses import dataclass

import pytest

from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import load, param, table


@dataclass(frozen=True, kw_only=True)
class Inner:
    depth: int = param(3, lo=1, hi=9, doc="how deep")


@dataclass(frozen=True, kw_only=True)
class Outer:
    speed: float = param(0.5, unit="m/s", lo=0.0, doc="top speed")
    mode: str = param("a", choices=("a", "b"), doc="mode")
    flag: bool = param(False, doc="flag")
    names: list[str] = param(["x"], doc="names")
    corner: tuple[float, float] = param((0.0, 0.0), doc="corner")
    inner: Inner = param(Inner(), doc="nested")
    maybe: float | None = param(None, doc="may be absent")
    stops: tuple[Inner, ...] = param((), doc="a list of groups")
    lamps: dict[str, float] = param({}, doc="a group of any names")
    odd: float = param(1.0, name="acc_lim_Y", doc="another name outside")


def test_defaults() -> None:
    assert load(Outer, {}) == Outer()


def test_int_becomes_float_but_a_bool_is_no_int() -> None:
    assert load(Outer, {"speed": 1}).speed == 1.0
    with pytest.raises(ParamError, match=r"~speed: expected a number \[m/s\], got True"):
        load(Outer, {"speed": True})
    with pytest.raises(ParamError, match="~inner/depth: expected a whole number"):
        load(Outer, {"inner": {"depth": True}})


@pytest.mark.parametrize(
    ("tree", "said"),
    [
        ({"speed": -1.0}, "at least 0.0 m/s"),
        ({"speed": float("nan")}, "expected a number"),
        ({"mode": "c"}, "expected one of a, b"),
        ({"flag": 1}, "expected true or false"),
        ({"names": "x"}, "~names: expected a list, each a text, got 'x'"),
        ({"corner": 5}, "~corner: expected a list, each a number, got 5"),
        ({"stops": 5}, "~stops: expected a list, each a group of parameters, got 5"),
        ({"lamps": 5}, "~lamps: expected a group of parameters, got 5"),
        ({"maybe": "soon"}, "~maybe: expected a number, got 'soon'"),
        ({"names": [1]}, r"names\[0\]"),
        ({"corner": [1.0]}, "expected 2 values, got 1"),
        ({"inner": 3}, "expected a group"),
        ({"inner": {"depth": 10}}, "at most 9"),
    ],
)
def test_bad_values_name_the_parameter(tree: dict[str, object], said: str) -> None:
    with pytest.raises(ParamError, match=said):
        load(Outer, tree)


def test_missing_required() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Needy:
        path: str = param(doc="a file")

    with pytest.raises(ParamError, match="/node/path: is missing, expected a text"):
        load(Needy, {}, name="/node/")


def test_unknown_name_is_warned_of_with_the_nearest(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        load(Outer, {"sped": 1.0})
    assert "did you mean 'speed'?" in caplog.text


def test_other_name_and_table() -> None:
    assert load(Outer, {"acc_lim_Y": 2}).odd == 2.0
    assert "| `acc_lim_Y` | `1.0` |" in table(Outer)
    assert "| `speed` | `0.5` | m/s | top speed |" in table(Outer)


@dataclass(frozen=True, kw_only=True)
class Clamped:
    speed: float = param(0.5, unit="m/s", lo=0.0, hi=2.0, clamps="both", doc="top speed")
    voxels: int = param(10, lo=0, hi=16, clamps="both", doc="whole numbers stay whole")
    rate: float = param(20.0, lo=0.1, hi=100.0, clamps="above", doc="nothing works below")
    start: float = param(1.5, ignores_nan=True, doc="where it starts")
    baud: int = param(9600, lo=50, reads_text=True, doc="speed of a port")
    ports: tuple[int, ...] = param((), lo=0, reads_text=True, doc="several")
    size: float = param(0.5, lo=0.0, hi=2.0, doc="has no bounds upstream")


@pytest.mark.parametrize(
    ("tree", "used"),
    [
        ({"speed": -0.3}, 0.0),
        ({"speed": 2.5}, 2.0),
        ({"speed": 3}, 2.0),
        ({"speed": float("inf")}, 2.0),
        ({"voxels": 32}, 16),
        ({"voxels": -1}, 0),
        ({"rate": 150}, 100.0),
    ],
)
def test_a_value_out_of_upstreams_bounds_becomes_the_bound_and_is_said(tree, used, caplog):
    ((name, given),) = tree.items()
    found = getattr(load(Clamped, tree, name="/move_base/X/"), name)
    assert (found, type(found)) == (used, type(used))
    shown = float(given) if isinstance(used, float) else given
    assert caplog.messages == [f"/move_base/X/{name} is {shown}, which is out of bounds: {used} is taken"]


@pytest.mark.parametrize("tree", [{"speed": 2.0, "voxels": 0, "rate": 0.1}, {"speed": 0, "voxels": 16}])
def test_a_bound_itself_is_not_clamped(tree, caplog):
    load(Clamped, tree)
    assert not caplog.messages


@pytest.mark.parametrize(
    ("tree", "said"),
    [
        ({"rate": 0.0}, "~rate: is 0.0, expected at least 0.1"),
        ({"speed": float("nan")}, "~speed: expected a number"),
        ({"speed": "fast"}, "~speed: expected a number"),
        ({"size": 3.0}, "~size: is 3.0, expected at most 2.0"),
        ({"baud": "fast"}, "~baud: expected a whole number, got 'fast'"),
        ({"baud": "115200.0"}, "~baud: expected a whole number"),
        ({"baud": "10"}, "~baud: is 10, expected at least 50"),
        ({"voxels": "10"}, "~voxels: expected a whole number, got '10'"),
        ({"start": "nan"}, "~start: expected a number"),
    ],
)
def test_what_upstream_cannot_use_either_is_an_error(tree, said):
    with pytest.raises(ParamError, match=said):
        load(Clamped, tree)


def test_nan_becomes_the_default(caplog):
    assert load(Clamped, {"start": float("nan")}, name="/amcl/").start == 1.5
    assert caplog.messages == ["/amcl/start is NaN, its default 1.5 is taken"]


@pytest.mark.parametrize("given", ["115200", " 115200 ", "+115200", 115200, 115200.0])
def test_a_number_in_quotes_is_a_number_where_upstream_takes_int(given):
    assert load(Clamped, {"baud": given, "ports": [given, 7]}) == Clamped(baud=115200, ports=(115200, 7))


def test_a_group_with_other_defaults_has_them_in_the_table() -> None:
    assert "| `depth` | `3` |" in table(Inner)
    assert "| `depth` | `5` |" in table(Inner, Inner(depth=5))
