"""Tiles that maps share until they are written to, and what scans leave in them."""

from __future__ import annotations

import numpy as np
import pytest
from mapped_room import scan_at, small

from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.gmapping import tile_kernels as kernels
from rosbot_patrol.gmapping.beams import Beams, pick_beams
from rosbot_patrol.gmapping.particle_map import ParticleMaps
from rosbot_patrol.grid import Grid, GridInfo

STILL = np.zeros((1, 3))


def maps(count: int = 1, half: float = 8.0) -> ParticleMaps:
    return ParticleMaps((-half, -half), (half, half), 0.05, count)


def room_beams() -> Beams:
    return pick_beams(scan_at(Pose2D()), Pose2D(), small())


def beam_to(x: float, y: float, *, is_hit: bool = True) -> Beams:
    length = np.hypot(x, y)
    return Beams(
        ends=np.array([[x, y]]),
        directions=np.array([[x, y]]) / length,
        is_hit=np.array([is_hit]),
        sensor=np.zeros(2),
        spacing=0.01,
    )


def test_the_extent_is_rounded_down_to_patches_as_upstream_does() -> None:
    info = maps(half=50.0).info
    assert (info.width, info.height, info.origin_x, info.origin_y) == (1984, 1984, -50.0, -50.0)


@pytest.mark.parametrize("lows", [(8.0, -8.0), (-float("inf"), -8.0), (-1e5, -8.0)])
def test_an_extent_that_makes_no_sense_is_named(lows: tuple[float, float]) -> None:
    with pytest.raises(MapError, match="expected xmin < xmax"):
        ParticleMaps(lows, (8.0, 8.0), 0.05, 1)


def test_a_beam_frees_its_way_and_marks_its_end() -> None:
    made = maps()
    made.register(STILL, beam_to(1.02, 0.02))
    grid = made.grid(0, 0.25)
    assert grid.at(1.02, 0.02) == 100
    assert all(grid.at(x, 0.02) == 0 for x in np.arange(0.02, 0.95, 0.05))
    assert grid.at(1.07, 0.02) == -1
    assert np.count_nonzero(grid.cells == 100) == 1


def test_a_beam_that_is_cut_marks_nothing() -> None:
    made = maps()
    made.register(STILL, beam_to(1.02, 0.02, is_hit=False))
    cells = made.grid(0, 0.25).cells
    assert not (cells == 100).any()
    assert (cells == 0).sum() == 20


def test_a_cell_is_a_wall_above_the_threshold_only() -> None:
    made = maps()
    for _ in range(3):
        made.register(STILL, beam_to(2.02, 0.02))
    made.register(STILL, beam_to(1.02, 0.02))
    assert made.grid(0, 0.25).at(1.02, 0.02) == 0  # one of four, and not more than a quarter
    assert made.grid(0, 0.24).at(1.02, 0.02) == 100


def test_a_cell_keeps_the_mean_place_of_its_hits() -> None:
    made = maps()
    for x in (1.01, 1.02, 1.03):
        made.register(STILL, beam_to(x, 0.02))
    ix, iy = made.info.cell_of(1.02, 0.02)
    tile = made.tables[0, iy >> 4, ix >> 4]
    record = made.cells[tile, (iy & 15) * 16 + (ix & 15)]
    assert record[kernels.HITS] == 3
    assert record[kernels.MEAN_X] / kernels.FULL * 0.05 == pytest.approx(0.02, abs=1e-5)


def walls_of(made: ParticleMaps) -> tuple[np.ndarray, np.ndarray]:
    """Of the first map, asked for seven cells at a time, and as hits and visits say."""
    info = made.info
    told, true = np.zeros(info.shape, dtype=bool), np.zeros(info.shape, dtype=bool)
    for iy in range(info.height):
        for ix in range(0, info.width, 7):
            bits = kernels.walls_from(made.tables[0], made.cells, ix, iy, 7)
            told[iy, ix : ix + 7] = [(bits >> k) & 1 for k in range(min(7, info.width - ix))]
    for ty, tx in np.argwhere(made.tables[0] >= 0):
        cells = made.cells[made.tables[0, ty, tx], : kernels.AREA].astype(int).reshape(16, 16, -1)
        walls = cells[..., kernels.HITS] * kernels.FULL_SHARE > cells[..., kernels.VISITS]
        true[ty * 16 : ty * 16 + 16, tx * 16 : tx * 16 + 16] = walls
    return told, true


def test_walls_are_told_from_hits_and_visits() -> None:
    made = maps(2, half=4.0)
    rng = np.random.default_rng(3)
    for _ in range(12):
        made.register(rng.normal(0.0, [0.3, 0.3, 0.5], (2, 3)), room_beams())  # far apart: some walls are worn away
        made.select(np.array([1, 0]))
    told, true = walls_of(made)
    assert 100 < true.sum() < 5000
    assert (told == true).all()


def test_walls_of_a_saved_map_and_beyond_its_edge() -> None:
    made = maps(half=4.0)
    cells = np.where(np.random.default_rng(4).random((50, 70)) < 0.3, 100, 0).astype(np.int8)
    made.seed(Grid(GridInfo(resolution=0.05, width=70, height=50, origin_x=-1.0, origin_y=-1.0), cells))
    told, true = walls_of(made)
    assert true.sum() == (cells == 100).sum()
    assert (told == true).all()
    assert kernels.walls_from(made.tables[0], made.cells, -30, -1, 21) == 0
    assert kernels.walls_from(made.tables[0], made.cells, 10**6, 5, 21) == 0


def test_counts_that_would_overflow_are_halved() -> None:
    made = maps()
    made.register(STILL, beam_to(1.02, 0.02))
    made.cells[made.cells[:, :, kernels.HITS] == 1, : kernels.VISITS + 1] = kernels.FULL
    made.register(STILL, beam_to(1.02, 0.02))
    ix, iy = made.info.cell_of(1.02, 0.02)
    record = made.cells[made.tables[0, iy >> 4, ix >> 4], (iy & 15) * 16 + (ix & 15)]
    assert record[kernels.HITS] == record[kernels.VISITS] == 32768


def test_beams_that_graze_a_wall_do_not_wear_it_away() -> None:
    made = maps()
    angles = np.radians(np.linspace(1.0, 30.0, 300))
    ends = np.column_stack((0.51 / np.tan(angles), np.full(300, 0.51)))
    ends = ends[ends[:, 0] < 6.0]
    count = len(ends)
    wall = Beams(ends=ends, directions=ends, is_hit=np.ones(count, dtype=bool), sensor=np.zeros(2), spacing=0.002)
    for _ in range(3):
        made.register(STILL, wall)
    grid = made.grid(0, 0.25)
    assert all(grid.at(x, 0.51) == 100 for x in np.arange(1.0, 2.0, 0.05))


def test_particles_of_one_line_share_their_tiles_until_they_write() -> None:
    made = maps(8)
    made.register(np.zeros((8, 3)), room_beams())
    alone = made.tiles_used // 8
    made.select(np.zeros(8, dtype=np.int64))
    assert made.tiles_used == alone
    before = made.grid(1, 0.25).cells
    made.write(made.tables[0], np.array([160.0, 160.0]), np.array([[200.5, 160.5]]), np.array([True]))
    assert alone < made.tiles_used <= alone + 4
    assert (made.grid(1, 0.25).cells == before).all()
    assert (made.grid(0, 0.25).cells != before).any()


def test_tiles_of_particles_that_died_are_used_again() -> None:
    made = maps(4)
    beams = room_beams()
    poses = np.zeros((4, 3))
    made.register(poses, beams)
    size = len(made.refs)
    for _ in range(10):
        made.select(np.array([2, 2, 3, 3]))
        made.register(poses, beams)
    assert len(made.refs) <= size * 1.5
    counts = np.bincount(made.tables[made.tables >= 0], minlength=len(made.refs))
    assert (counts == made.refs).all()
    unused = made.free[1 : 1 + made.free[0]]
    assert sorted(unused) == np.flatnonzero(made.refs == 0).tolist()


def test_a_map_grows_where_the_robot_leaves_it() -> None:
    made = maps(2)
    poses = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    made.register(poses, room_beams())
    old = made.grid(0, 0.25)
    made.register(poses - (30.0, 0.0, 0.0), room_beams())
    new = made.grid(0, 0.25)
    shift = round((old.info.origin_x - new.info.origin_x) / 0.05)
    assert new.info.origin_x < -34.0
    assert new.info.origin_x == pytest.approx(old.info.origin_x - shift * 0.05)
    kept = new.cells[: old.cells.shape[0], shift : shift + old.cells.shape[1]]
    assert (kept[old.cells == 100] == 100).all()


def test_a_saved_map_is_gone_on_with() -> None:
    made = maps()
    made.register(STILL, room_beams())
    saved = made.grid(0, 0.25)
    info = GridInfo(resolution=0.05, width=saved.info.width, height=saved.info.height, origin_x=-7.98, origin_y=-8.01)
    again = maps(3)
    again.seed(Grid(info, saved.cells))
    grid = again.grid(2, 0.25)
    row, column = (round(v / 0.05) for v in (-8.01 - grid.info.origin_y, -7.98 - grid.info.origin_x))
    part = grid.cells[row : row + info.height, column : column + info.width]
    assert (part == saved.cells).all()
    assert np.count_nonzero(grid.cells != -1) == np.count_nonzero(saved.cells != -1)
    assert again.refs[again.tables[0][again.tables[0] >= 0]].tolist() == [3] * again.tiles_used


def test_a_saved_map_of_other_cells_is_refused() -> None:
    grid = Grid(GridInfo(resolution=0.1, width=10, height=10), np.zeros((10, 10), dtype=np.int8))
    with pytest.raises(MapError, match=r"its cells are 0.1 m, expected delta, 0.05 m"):
        maps().seed(grid)
