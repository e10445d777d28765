"""The replay program and its test cases: what they say, and their exit status."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from made_bag import write_bag
from made_drive import drive_messages

from rosbot_patrol.errors import ParamError
from rosbot_patrol.files import cache_dir
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.package_files import package_file
from rosbot_patrol.replay import program
from rosbot_patrol.replay.case import read_case
from rosbot_patrol.replay.nodes.setup import parse_transform
from rosbot_patrol.replay.results.tables import load_result, save_result

pytest_plugins = ["pytester"]

KERNELS = str(cache_dir().parent)
PARAMETERS = "{max_particles: 300, update_min_d: 0.1, update_min_a: 0.1, resample_interval: 1}"


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    write_bag(folder / "drive.bag", drive_messages(4.0))
    (folder / "amcl.yaml").write_text(PARAMETERS)
    return folder


@pytest.fixture
def run(drive: Path, capsys: pytest.CaptureFixture[str]):
    def call(*words: object) -> tuple[int, str]:
        status = program.run([str(word) for word in words])
        said = capsys.readouterr()
        return status, said.out + said.err

    return call


def amcl(drive: Path, *more: object) -> tuple[object, ...]:
    return (drive / "drive.bag", "--node", "amcl", "--params", drive / "amcl.yaml", *more)


def test_without_a_node_it_says_what_is_there(run, drive: Path) -> None:
    status, said = run(drive / "drive.bag")
    assert status == 0
    assert "/scan              20  sensor_msgs/LaserScan" in said
    assert "--node slam_gmapping: has all that it needs" in said


def test_record_then_check_is_the_same(run, drive: Path, tmp_path: Path) -> None:
    status, said = run(*amcl(drive, "--record", tmp_path / "a.npz"))
    assert (status, "stored in" in said, "scans 20" in said) == (0, True, True)
    status, said = run(*amcl(drive, "--check", tmp_path / "a.npz", "--exact"))
    assert (status, "bit for bit" in said) == (0, True)
    assert run(*amcl(drive, "--check", tmp_path / "a.npz", "--quiet")) == (0, "")


def test_a_difference_is_printed_and_drawn(run, drive: Path, tmp_path: Path) -> None:
    run(*amcl(drive, "--record", tmp_path / "a.npz"))
    stored = load_result(tmp_path / "a.npz")
    stored.tables["poses"]["x"][4:] += 0.3
    save_result(tmp_path / "a.npz", stored)
    status, said = run(*amcl(drive, "--check", tmp_path / "a.npz", "--plots", tmp_path / "plots"))
    assert status == 1
    assert "differs from" in said
    assert "poses.x: " in said
    assert "worst by 0.3 m" in said
    drawing = (tmp_path / "plots" / "poses.svg").read_text()
    assert drawing.count("<circle") == len(stored.tables["poses"]["x"]) - 4
    assert "poses.x [m]" in drawing
    assert run(*amcl(drive, "--check", tmp_path / "a.npz", "--tolerance", "poses.x=0.31"))[0] == 0
    assert run(*amcl(drive, "--check", tmp_path / "a.npz", "--tolerance", "poses.*=0.31"))[0] == 0


def test_another_seed_is_not_exactly_the_same(run, drive: Path, tmp_path: Path) -> None:
    run(*amcl(drive, "--record", tmp_path / "a.npz"))
    assert run(*amcl(drive, "--check", tmp_path / "a.npz", "--seed", 7, "--exact"))[0] == 1


def test_slam_writes_a_map_that_map_server_reads(run, drive: Path, tmp_path: Path) -> None:
    (tmp_path / "slam.yaml").write_text("slam_gmapping: {particles: 2, linearUpdate: 0.5, xmin: -6.0, xmax: 6.0}")
    words = (drive / "drive.bag", "--node", "slam_gmapping", "--params", tmp_path / "slam.yaml")
    status, _ = run(*words, "--save-map", tmp_path / "room", "--plots", tmp_path / "plots")
    assert status == 0
    assert np.count_nonzero(read_map(tmp_path / "room.yaml").cells == 100) > 200
    assert (tmp_path / "plots" / "map.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("none.bag", "--node", "amcl"), "none.bag: there is no such bag"),
        (("{drive}/drive.bag", "--node", "amcl", "--map", "none.yaml"), "none.yaml: the map's yaml cannot be read"),
        (
            ("{drive}/drive.bag", "--node", "amcl", "--check", "none.npz"),
            "the stored result cannot be read: No such file",
        ),
        (("{drive}/drive.bag", "--node", "amcl", "--params", "none.yaml"), "none.yaml: cannot be read: No such file"),
        (
            ("{drive}/drive.bag", "--node", "amcl", "lidar:=/scan"),
            "nothing is called 'lidar' there, expected one of",
        ),
        (("{drive}/drive.bag", "--node", "amcl", "--record"), "--record: expected the file to store the result in"),
        (("{drive}/drive.bag", "--node", "amcl", "--tolerance", "x"), "expected FIELD=VALUE as poses.x=0.1, got 'x'"),
        (
            ("{drive}/drive.bag", "--node", "amcl", "--transform", "1 2 a b"),
            "expected 'x y z yaw pitch roll PARENT CHILD'",
        ),
        (("{drive}/drive.bag", "--node", "amcl", "--save-map", "m"), "--save-map: amcl makes no map"),
    ],
)
def test_bad_input_is_a_sentence_and_2(run, drive: Path, words: tuple[str, ...], sentence: str) -> None:
    status, said = run(*(word.format(drive=drive) for word in words))
    assert status == 2
    assert sentence in said
    assert "Traceback" not in said


def test_no_update_is_told_with_its_reason_and_writes_nothing(run, tmp_path: Path) -> None:
    messages = [each for each in drive_messages(3.0) if each[1] != "/tf_static"]
    path = write_bag(tmp_path / "a.bag", messages)
    status, said = run(path, "--node", "slam_gmapping", "--save-map", tmp_path / "map", "--record", tmp_path / "a.npz")
    assert status == 1
    assert "slam_gmapping has made no update over" in said
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.bag"]
    assert "left out: no transform from 'laser' to 'base_link': nothing was told of the frame 'laser'" in said
    assert "--transform 'x y z yaw pitch roll base_link laser' gives a missing transform" in said


def test_a_bag_without_messages(run, tmp_path: Path) -> None:
    path = write_bag(tmp_path / "empty.bag", [])
    assert run(path)[0] == 0
    status, said = run(path, "--node", "slam_gmapping")
    assert status == 2
    assert "has no topic '/scan' (sensor_msgs/LaserScan) and no other of that type; it has no topics" in said


def test_a_file_of_the_package_that_is_nowhere() -> None:
    with pytest.raises(ParamError, match=r"config/none\.yaml: is in none of"):
        package_file("config/none.yaml")


def test_a_tolerance_of_what_is_not_there(run, drive: Path, tmp_path: Path) -> None:
    run(*amcl(drive, "--record", tmp_path / "a.npz"))
    status, said = run(*amcl(drive, "--check", tmp_path / "a.npz", "--tolerance", "pose.x=1"))
    assert status == 2
    assert "tolerance of pose.x: 'pose.x' is not known here, did you mean 'poses.x'?" in said


def test_transforms_as_static_transform_publisher_takes_them() -> None:
    edge = parse_transform("0.1 0.2 0.3 1.5707963 0 0 base_link laser")
    assert edge[:2] == ("base_link", "laser")
    assert edge[3:] == pytest.approx((0.1, 0.2, 0.3, 0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))
    assert parse_transform("0 0 0 0 0 3.1415927 a b")[6:] == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-6)
    assert parse_transform("0 0 0 0 1 0 0 a b")[6:] == (0.0, 1.0, 0.0, 0.0)


def write_case(folder: Path, drive: Path, text: str = "") -> Path:
    path = folder / "drive.replay.yaml"
    path.write_text(f"bag: {drive}/drive.bag\nnode: amcl\nparameters: {drive}/amcl.yaml\n{text}")
    return path


def test_a_case_is_recorded_and_checked(run, drive: Path, tmp_path: Path) -> None:
    case = write_case(tmp_path, drive, "seed: 3\ntolerances: {poses.x: 0.2, health.*: 1}\n")
    status, said = run(case)
    assert (status, "drive.expected.npz: the stored result cannot be read" in said) == (2, True)
    assert run(case, "--record")[0] == 0
    assert (tmp_path / "drive.expected.npz").exists()
    status, said = run(case)
    assert (status, "bit for bit" in said) == (0, True)
    fields = read_case(case).fields
    assert (fields["poses.x"].tolerance, fields["poses.x"].unit, fields["poses.y"].tolerance) == (0.2, "m", 0.05)
    assert (fields["health.x"].tolerance, fields["health.yaw"].is_angle) == (1.0, True)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("topic: {}\n", "topic: 'topic' is not known here, did you mean 'topics'?"),
        ("seed: -1\n", "seed: is -1, expected at least 0"),
        ("tolerances: {poses.x: much}\n", "tolerances/poses.x: expected a number from 0 up, got 'much'"),
        ("transforms: [hello]\n", "expected 'x y z yaw pitch roll PARENT CHILD'"),
    ],
)
def test_a_case_that_makes_no_sense(drive: Path, tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(ParamError) as caught:
        read_case(write_case(tmp_path, drive, text))
    assert sentence in str(caught.value)


def test_a_node_that_cannot_be_replayed(tmp_path: Path) -> None:
    (tmp_path / "a.replay.yaml").write_text("bag: a.bag\nnode: acml\n")
    with pytest.raises(ParamError, match="did you mean 'amcl'"):
        read_case(tmp_path / "a.replay.yaml")


def test_the_pytest_plugin(
    drive: Path, tmp_path: Path, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROSBOT_PATROL_CACHE", KERNELS)  # pytester has a home of its own
    write_case(tmp_path, drive)
    missing = tmp_path / "missing.replay.yaml"
    missing.write_text("bag: none.bag\nnode: amcl\noptional: true\n")

    def called(*more: str) -> tuple[int, str]:
        plain = ("-p", "no:hypothesispytest", "--assert=plain", "-rs")  # quick to start
        words = ("-p", "rosbot_patrol.replay.pytest_plugin", *plain, str(tmp_path), *more)
        done = pytester.runpytest_inprocess(*words)
        return int(done.ret), done.stdout.str()

    status, said = called()
    assert status == 1
    assert "drive.expected.npz: the stored result cannot be read: No such file" in said
    assert called("--replay-record")[0] == 0
    stored = load_result(tmp_path / "drive.expected.npz")
    stored.tables["poses"]["yaw"][:] += 0.5
    save_result(tmp_path / "drive.expected.npz", stored)
    status, said = called("--replay-plots", str(tmp_path / "plots"))
    assert status == 1
    assert "worst by 0.5 rad" in said
    assert "1 failed, 1 skipped" in said
    assert "there is no bag" in said
    assert (tmp_path / "plots" / "drive" / "poses.svg").exists()
