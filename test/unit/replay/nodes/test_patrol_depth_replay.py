"""The patrol over bags with a lens, scans, a map and depth: boxes are measured as on the robot."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_bag import write_bag
from made_patrol import POINTS, looking
from made_sight import DEPTH_INFO, DEPTH_TOPIC, IMAGE, SightedWorld

from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.nodes.patrol_records import KINDS
from rosbot_patrol.replay.nodes.setup import Setup, build_replay
from rosbot_patrol.replay.results.tables import Result
from rosbot_patrol.replay.runner import run_replay


def recorded(path: Path, **given: Any) -> SightedWorld:
    """One mission; somebody stands before the robot in room 2."""
    world = SightedWorld(person_when=lambda w: looking(w) and w.x > 19.0, **given)
    for _ in range(25):
        world.step()
    world.mission(2)
    for _ in range(5):
        world.step()
    (path.parent / "rooms.yaml").write_text(POINTS)
    write_bag(path, sorted(world.messages, key=lambda each: each[0]), latching=["/tf_static"])
    return world


def replayed(path: Path, **parameters: Any) -> Result:
    tree = {"look_around": "spin", **parameters}
    with Bag(path) as bag:
        return run_replay(bag, build_replay(Setup(node="patrol_robot", tree=tree, rooms=path.parent / "rooms.yaml")))


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("bags")
    given: dict[str, dict[str, bool]] = {
        "plain": {},
        "depth": {"has_depth": True},
        "flat": {"has_depth": True, "is_flat": True},
    }
    for name, options in given.items():
        recorded(folder / f"{name}.bag", **options)
    return {name: folder / f"{name}.bag" for name in given}


def test_without_depth_the_lidar_tells_where_somebody_stands(bags: dict[str, Path]) -> None:
    result = replayed(bags["plain"])
    assert result.tables["verdicts"]["verdict"].tolist() == ["confirmed"]
    assert result.tables["notices"]["x"][0] == pytest.approx(22.5, abs=0.15)


def test_depth_tells_it_where_the_bag_has_depth(bags: dict[str, Path]) -> None:
    plain, depth = replayed(bags["plain"]), replayed(bags["depth"])
    assert depth.tables["verdicts"]["verdict"].tolist() == ["confirmed"]
    assert depth.tables["notices"]["x"][0] == pytest.approx(22.5, abs=0.15)
    assert depth.digest != plain.digest
    assert replayed(bags["depth"]).digest == depth.digest


def test_a_picture_on_the_wall_is_told_by_its_depth(bags: dict[str, Path]) -> None:
    result = replayed(bags["flat"])
    assert result.counts["notices"] == 0
    assert "it is flat, a picture or a screen" in result.tables["verdicts"]["reason"][0]


def test_the_lens_of_a_depth_camera_alone_changes_nothing_and_ends_no_rest(
    bags: dict[str, Path], tmp_path: Path
) -> None:
    world = recorded(tmp_path / "plain.bag")
    info = next(message for _, topic, message in world.messages if topic == "/camera/rgb/camera_info")
    first, last = world.messages[0][0], world.messages[-1][0]
    lenses = [(stamp, DEPTH_INFO, info) for stamp in np.arange(first, last, 0.1).tolist()]
    write_bag(tmp_path / "lens.bag", sorted([*world.messages, *lenses], key=lambda each: each[0]))
    assert replayed(tmp_path / "lens.bag").digest == replayed(bags["plain"]).digest


def test_a_patrol_without_a_depth_topic_does_as_without_depth(bags: dict[str, Path]) -> None:
    without = replayed(bags["flat"], eyes={"depth_topic": ""})
    assert without.digest == replayed(bags["plain"]).digest


def test_a_picture_of_ros_1_is_read_as_rosbags_reads_it() -> None:
    made = SightedWorld(has_depth=True, person_when=lambda _world: True)
    made.step()
    for _ in range(3):
        made.step()
    message = next(each for _, topic, each in made.messages if topic == DEPTH_TOPIC)
    raw, kind = made._make.bytes(message), KINDS[IMAGE]
    assert kind.fast is not None
    fast, whole = kind.fast(raw), kind.convert(made._make.store.deserialize_ros1(raw, IMAGE))
    assert fast == whole
    assert kind.md5 == made._make.store.generate_msgdef(IMAGE, ros_version=1)[1]
    assert np.frombuffer(fast.data, np.uint16).min() > 2000
    with pytest.raises(struct.error, match="does not fit"):
        kind.fast(raw[:-1])
