"""Maps on disk: as map_server reads them, as map_saver writes them, and what is said where they are broken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.errors import MapError
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import map_bytes, read_map, read_map_file, write_map

YAML = """image: map.pgm
resolution: 0.05
origin: [-1.0, -2.0, 0.5]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def save(folder: Path, yaml: str = YAML, pgm: bytes = b"P5\n3 2\n255\n" + bytes([0, 205, 254, 254, 254, 0])) -> Path:
    (folder / "map.pgm").write_bytes(pgm)
    (folder / "map.yaml").write_text(yaml)
    return folder / "map.yaml"


def cells_of(folder: Path, pixels: list[int], *, mode: str = "trinary", negate: int = 0) -> list[int]:
    text = YAML.replace("negate: 0", f"negate: {negate}") + f"mode: {mode}\n"
    header = f"P5 {len(pixels)} 1 255 ".encode()
    return read_map(save(folder, text, header + bytes(pixels))).cells[0].tolist()


def test_the_top_row_of_the_picture_is_the_highest_y(tmp_path: Path) -> None:
    grid = read_map(save(tmp_path))
    assert grid.cells.tolist() == [[0, 0, 100], [100, -1, 0]]
    assert grid.info == GridInfo(resolution=0.05, width=3, height=2, origin_x=-1.0, origin_y=-2.0, yaw=0.5)


def test_trinary_thresholds_are_upstreams(tmp_path: Path) -> None:
    # (255 - 205) / 255 = 0.19608 > 0.196; (255 - 89) / 255 = 0.65098 > 0.65
    assert cells_of(tmp_path, [0, 89, 90, 205, 206, 255]) == [100, 100, -1, -1, 0, 0]


def test_scale_grades_what_lies_between(tmp_path: Path) -> None:
    assert cells_of(tmp_path, [0, 90, 148, 205, 254], mode="scale") == [100, 98, 49, 1, 0]


def test_raw_takes_the_values(tmp_path: Path) -> None:
    assert cells_of(tmp_path, [0, 42, 100, 255], mode="raw") == [0, 42, 100, -1]


def test_negate_turns_white_into_wall(tmp_path: Path) -> None:
    assert cells_of(tmp_path, [255, 0, 50], negate=1) == [100, 0, -1]


def test_text_pgm_with_comments_and_other_largest_value(tmp_path: Path) -> None:
    pgm = b"P2\n# by hand\n3 1\n# largest\n15\n0 7 # half\n15\n"
    assert read_map(save(tmp_path, pgm=pgm)).cells.tolist() == [[100, -1, 0]]


def test_sixteen_bit_pgm(tmp_path: Path) -> None:
    pgm = b"P5\n2 1\n65535\n" + b"\x00\x00" + b"\xff\xff"
    assert read_map(save(tmp_path, pgm=pgm)).cells.tolist() == [[100, 0]]


@pytest.mark.parametrize("kind", ["png", "bmp"])
def test_png_and_bmp(tmp_path: Path, kind: str) -> None:
    cv2 = pytest.importorskip("cv2")
    cv2.imwrite(str(tmp_path / f"map.{kind}"), np.array([[0, 205, 254]], dtype=np.uint8))
    path = save(tmp_path, YAML.replace("map.pgm", f"map.{kind}"))
    assert read_map(path).cells.tolist() == [[100, -1, 0]]


def test_colours_are_averaged_and_alpha_marks_the_unknown(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    pixels = np.array([[[0, 0, 0, 255], [254, 254, 254, 255], [150, 150, 150, 0], [150, 150, 150, 255]]], np.uint8)
    cv2.imwrite(str(tmp_path / "map.png"), pixels)
    path = save(tmp_path, YAML.replace("map.pgm", "map.png") + "mode: scale\n")
    assert read_map(path).cells.tolist() == [[100, 0, -1, 47]]


@pytest.mark.parametrize("kind", ["png", "bmp"])
def test_a_cut_picture_is_named(tmp_path: Path, kind: str) -> None:
    cv2 = pytest.importorskip("cv2")
    picture = np.random.default_rng(0).integers(0, 255, (40, 40), dtype=np.uint8)
    data = cv2.imencode(f".{kind}", picture)[1].tobytes()
    (tmp_path / f"map.{kind}").write_bytes(data[: len(data) // 2])
    with pytest.raises(MapError, match=rf"map\.{kind}.*cut short"):
        read_map(save(tmp_path, YAML.replace("map.pgm", f"map.{kind}")))


@pytest.mark.parametrize(
    ("yaml", "says"),
    [
        (YAML.replace("resolution: 0.05", ""), r"map\.yaml: key 'resolution' is missing"),
        (YAML.replace("image: map.pgm", ""), "key 'image' is missing"),
        (YAML.replace("origin", "orgin"), "key 'origin' is missing"),
        (YAML.replace("negate: 0", ""), "key 'negate' is missing"),
        (YAML.replace("occupied_thresh: 0.65", ""), "key 'occupied_thresh' is missing"),
        (YAML.replace("free_thresh: 0.196", ""), "key 'free_thresh' is missing"),
        (YAML.replace("0.05", "-1"), "key 'resolution' is -1.0, expected more than 0"),
        (YAML.replace("0.05", "fine"), "key 'resolution' is 'fine', expected a number"),
        (YAML.replace(", 0.5]", "]"), r"key 'origin' is \[-1.0, -2.0\], expected \[x, y, yaw\]"),
        (YAML.replace("-1.0", ".nan"), "key 'origin'"),
        (YAML.replace("map.pgm", "gone.pgm"), r"gone\.pgm: the map's picture cannot be read: No such file"),
        (YAML.replace("map.pgm", ""), "key 'image'"),
        (YAML + "mode: grey\n", "key 'mode' is 'grey', expected one of trinary, scale, raw"),
        (YAML.replace("negate: 0", "negate: 7"), "key 'negate' is 7"),
        (YAML.replace("]", ""), r"map\.yaml: is no valid yaml in line"),
        ("just a text", "expected a yaml with the keys"),
        ("", "expected a yaml with the keys"),
    ],
)
def test_broken_yaml_is_named(tmp_path: Path, yaml: str, says: str) -> None:
    with pytest.raises(MapError, match=says):
        read_map(save(tmp_path, yaml))


@pytest.mark.parametrize(
    ("pgm", "says"),
    [
        (b"P5\n3 2\n255\n" + bytes(5), "cut short: 5 bytes of pixels, expected 6"),
        (b"P5\n3", "cut short or broken: its header has no height"),
        (b"P5\n0 2\n255\n", "header is broken"),
        (b"P5\n99999 99999\n255\n", "header is broken"),
        (b"P2\n2 1\n255\n7", "cut short: 1 pixel value, expected 2"),
        (b"P2\n2 1\n255\n7 x", "no number"),
        (b"", "no picture"),
        (b"GIF or whatever", "no picture"),
    ],
)
def test_broken_picture_is_named(tmp_path: Path, pgm: bytes, says: str) -> None:
    with pytest.raises(MapError, match=says):
        read_map(save(tmp_path, pgm=pgm))


def test_missing_yaml_is_named(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"nowhere\.yaml: the map's yaml cannot be read: No such file"):
        read_map(tmp_path / "nowhere.yaml")


def test_a_binary_yaml_is_named(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_bytes(b"image: \x81\xff")
    with pytest.raises(MapError, match="no valid yaml"):
        read_map(tmp_path / "map.yaml")


def test_numbers_that_yaml_reads_as_text(tmp_path: Path) -> None:
    assert read_map_file(save(tmp_path, YAML.replace("0.05", "5e-2"))).resolution == 0.05


def test_bytes_are_map_savers() -> None:
    info = GridInfo(resolution=0.05, width=3, height=2, origin_x=-50.0, origin_y=-50.0)
    grid = Grid(info, np.array([[0, 25, 26], [64, 65, -1]], dtype=np.int8))
    pgm, text = map_bytes(grid, "rosbot_map.pgm")
    assert pgm == b"P5\n# CREATOR: map_saver.cpp 0.050 m/pix\n3 2\n255\n" + bytes([205, 0, 205, 254, 254, 205])
    assert text == (
        b"image: rosbot_map.pgm\nresolution: 0.050000\norigin: [-50.000000, -50.000000, 0.000000]\n"
        b"negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n\n"
    )


def test_thresholds_of_map_saver() -> None:
    info = GridInfo(resolution=0.05, width=4, height=1)
    grid = Grid(info, np.array([[10, 11, 89, 90]], dtype=np.int8))
    assert map_bytes(grid, "m.pgm", occupied=90, free=10)[0][-4:] == bytes([254, 205, 205, 0])


def test_written_map_reads_back(tmp_path: Path) -> None:
    info = GridInfo(resolution=0.1, width=7, height=5, origin_x=-3.0, origin_y=1.5, yaw=0.25)
    cells = np.random.default_rng(1).choice(np.array([-1, 0, 100], dtype=np.int8), (5, 7))
    write_map(str(tmp_path / "made"), Grid(info, cells))
    found = read_map(tmp_path / "made.yaml")
    assert found.info == info
    np.testing.assert_array_equal(found.cells, cells)


def test_a_map_in_a_folder_reads_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "maps").mkdir()
    write_map("maps/made", Grid(GridInfo(resolution=0.1, width=1, height=1), np.zeros((1, 1), dtype=np.int8)))
    assert read_map("maps/made.yaml").cells.tolist() == [[0]]


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    grid = Grid(GridInfo(resolution=0.1, width=1, height=1), np.zeros((1, 1), dtype=np.int8))
    with pytest.raises(MapError, match="cannot be written"):
        write_map(str(tmp_path / "file" / "made"), grid)
