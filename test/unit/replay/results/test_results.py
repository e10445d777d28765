"""Results as a file, and the comparison of two."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import ResultError
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.replay.results.comparison import Field, compare, map_difference
from rosbot_patrol.replay.results.tables import Result, Rows, load_result, save_result

BEGIN = 1_600_000_000.0


def made(**columns: object) -> Result:
    """Five rows, one a second; columns as given."""
    table = {
        "stamp": BEGIN + np.arange(5.0),
        "x": np.array([0.0, 1.0, 2.0, 3.0, 4.0]),
        "yaw": np.full(5, math.pi - 0.01),
        "state": np.array(["localised"] * 5),
    }
    grid = Grid(GridInfo(resolution=0.1, width=3, height=2), np.array([[0, 100, -1], [0, 0, -1]], dtype=np.int8))
    return Result("amcl", {"bag": "a.bag"}, {"scans": 5}, {"poses": table | columns}, {"map": grid})


def said(found: Result, stored: Result | None = None, **fields: Field) -> list[str]:
    by_name = {name.replace("__", "."): field for name, field in fields.items()}
    return [str(each) for each in compare(stored or made(), found, by_name)]


def test_a_stored_result_is_read_as_it_was(tmp_path: Path) -> None:
    result = made(x=np.array([0.1, math.nan, math.inf, -1.0, 1e-300]))
    save_result(tmp_path / "a.npz", result)
    found = load_result(tmp_path / "a.npz")
    assert found.digest == result.digest
    assert (found.node, found.facts, found.counts) == ("amcl", {"bag": "a.bag"}, {"scans": 5})
    np.testing.assert_array_equal(found.tables["poses"]["x"], result.tables["poses"]["x"])
    assert found.tables["poses"]["state"].tolist() == ["localised"] * 5
    assert found.grids["map"].info == result.grids["map"].info
    save_result(tmp_path / "b.npz", result)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_the_digest_tells_results_apart_by_a_bit() -> None:
    one_bit = made().tables["poses"]["x"].copy()
    one_bit[3] = np.nextafter(3.0, 4.0)
    assert made().digest == made().digest
    assert made(x=one_bit).digest != made().digest
    assert replace(made(), counts={"scans": 6}).digest != made().digest
    assert replace(made(), facts={}).digest == made().digest


def test_files_that_are_no_results(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    with pytest.raises(ResultError, match="cannot be read: No such file"):
        load_result(path)
    path.write_text("hello")
    with pytest.raises(ResultError, match="is no stored result of a replay"):
        load_result(path)
    np.savez(path, other=np.zeros(3))
    with pytest.raises(ResultError, match="is no stored result of a replay"):
        load_result(path)
    np.savez(path, header=np.array('{"format": "something else"}'))
    with pytest.raises(ResultError, match="is of format 'something else'"):
        load_result(path)
    save_result(path, made())
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(ResultError, match="is no stored result of a replay"):
        load_result(path)


def test_rows_become_columns() -> None:
    rows = Rows("stamp", "count", "state")
    assert list(rows.table()) == ["stamp", "count", "state"]
    rows.add(1.0, 3, "lost")
    assert len(rows) == 1
    assert rows.table()["count"].dtype.kind == "i"
    with pytest.raises(ValueError, match="2 values for 3 columns"):
        rows.add(1.0, 3)


def test_the_same_is_the_same() -> None:
    assert said(made()) == []
    with_nan = made(x=np.full(5, math.nan))
    assert said(with_nan, with_nan) == []
    empty = replace(made(), tables={"poses": Rows("stamp", "x").table()})
    assert said(empty, empty) == []


def test_a_difference_names_field_first_time_worst_and_how_many() -> None:
    assert said(made(x=np.array([0.0, 1.0, 2.3, 2.0, 4.05])), poses__x=Field(tolerance=0.1, unit="m")) == [
        "poses.x: 2 of 5 rows differ by more than 0.1 m; first at 2.000 s (stored 2, now 2.3), worst by 1 m at 3.000 s"
    ]


def test_angles_are_wrapped() -> None:
    found = made(yaw=np.full(5, -math.pi + 0.01))
    assert said(found, poses__yaw=Field(tolerance=0.03, is_angle=True)) == []
    assert "worst by 0.02 at 0.000 s" in said(found, poses__yaw=Field(tolerance=0.01, is_angle=True))[0]


def test_texts_and_nan_differ_whatever_the_tolerance() -> None:
    state = np.array(["localised"] * 4 + ["lost"])
    assert said(made(state=state), poses__state=Field(tolerance=9.0)) == [
        "poses.state: 1 of 5 rows differ by more than 9; first at 4.000 s (stored localised, now lost)"
    ]
    x = np.array([0.0, math.nan, 2.0, 3.0, 4.0])
    assert "first at 1.000 s (stored 1, now nan)" in said(made(x=x), poses__x=Field(tolerance=9.0))[0]
    assert said(made(x=x), poses__x=Field(tolerance=math.inf)) == []


def test_rows_are_paired_by_their_time() -> None:
    table = {name: np.delete(values, 1) for name, values in made().tables["poses"].items()}
    less = replace(made(), tables={"poses": table})
    assert said(less) == ["poses.rows: 1 of 5 stored rows are missing (at 1.000 s)"]
    assert said(made(), less) == ["poses.rows: 1 of 5 rows are new (at 1.000 s)"]
    assert said(less, poses__rows=Field(tolerance=1)) == []
    later = made(stamp=made().tables["poses"]["stamp"] + 0.5)
    assert said(later) == [
        "poses.rows: 5 of 5 stored rows are missing (at 0.000, 1.000, 2.000, ... s); "
        "5 of 5 rows are new (at 0.500, 1.500, 2.500, ... s)"
    ]


def test_rows_of_one_time_are_paired_in_their_order() -> None:
    twice = made(stamp=BEGIN + np.array([0.0, 1.0, 1.0, 1.0, 2.0]))
    assert said(twice, twice) == []
    table = {name: np.delete(values, 3) for name, values in twice.tables["poses"].items()}
    assert said(replace(twice, tables={"poses": table}), twice) == [
        "poses.rows: 1 of 5 stored rows are missing (at 1.000 s)"
    ]


def test_counts_columns_tables_and_nodes() -> None:
    assert said(replace(made(), counts={"scans": 4, "late": 1})) == [
        "counts.scans: stored 5, now 4",
        "counts.late: stored none, now 1",
    ]
    assert said(replace(made(), counts={"scans": 4}), counts__scans=Field(tolerance=1)) == []
    table = dict(made().tables["poses"])
    del table["yaw"]
    assert said(replace(made(), tables={"poses": table})) == ["poses.yaw: is only in the stored result: record it anew"]
    assert said(replace(made(), tables={})) == ["poses: is only in the stored result"]
    assert said(replace(made(), node="slam_gmapping")) == ["node: the stored result is of amcl, not of slam_gmapping"]


def test_wildcards_give_way_to_names() -> None:
    found = made(x=np.arange(5.0) + 0.5)
    fields = {"poses.*": Field(tolerance=1.0), "poses.x": Field(tolerance=0.1)}
    assert len(compare(made(), found, fields)) == 1
    assert compare(made(), found, {"poses.*": Field(tolerance=1.0)}) == []


def test_maps_are_compared_where_they_lie() -> None:
    cells = np.full((6, 8), -1, dtype=np.int8)
    cells[1:5, 1:7] = 0
    cells[2, 2] = 100
    whole = Grid(GridInfo(resolution=0.1, width=8, height=6, origin_x=-1.0, origin_y=2.0), cells)
    part = Grid(GridInfo(resolution=0.1, width=6, height=4, origin_x=-0.9, origin_y=2.1), cells[1:5, 1:7].copy())
    assert map_difference(whole, part)[1] == map_difference(part, whole)[1] == 0.0
    changed = cells.copy()
    changed[3, 3], changed[5, 7] = 100, 0
    other = Grid(whole.info, changed)
    marks, share = map_difference(part, other)
    assert marks.shape == (6, 8)
    assert share == 2.0 / 25.0
    assert (marks[3, 3], marks[5, 7], marks[2, 2], marks[0, 0]) == (2, 2, 1, 0)
    coarse = Grid(GridInfo(resolution=0.2, width=8, height=6), cells)
    assert map_difference(whole, coarse)[1] == 1.0
    results = [replace(made(), grids={"map": grid}) for grid in (part, other)]
    assert said(results[1], results[0]) == ["map: 8.00% of 25 known cells differ (allowed 0.00%)"]
    assert said(results[1], results[0], map=Field(tolerance=0.1)) == []
