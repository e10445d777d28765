"""A costmap that is fed with records: poses, maps in other frames, masks, and what it says is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rosbot_patrol.costmap.costs import LETHAL
from rosbot_patrol.costmap.fed import Fault, FedCostmap
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import MapError
from rosbot_patrol.geometry import Pose2D, quaternion_from_yaw
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.maps.map_io import write_map
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.tf.tree import Edge, TransformTree

WALL = 2.0  # ahead of the laser [m]


def edge(parent: str, child: str, stamp: float, pose: Pose2D | None = None) -> Edge:
    pose = pose or Pose2D()
    return Edge(parent, child, stamp, pose.x, pose.y, 0.0, *quaternion_from_yaw(pose.yaw))


class Fed:
    """A costmap around a robot that stands at the origin of odom."""

    def __init__(self, *layers: tuple[str, str], zones: Path | None = None, **groups: object) -> None:
        self.frames = TransformTree()
        tree = {
            "plugins": [{"name": name, "type": f"costmap_2d::{kind}"} for name, kind in layers],
            "global_frame": "odom",
            "rolling_window": True,
            "width": 6.0,
            "height": 6.0,
            "resolution": 0.05,
            "robot_radius": 0.1,
            "transform_tolerance": 0.5,
            **groups,
        }
        config = read_costmap(tree)
        self.costmap = FedCostmap(config, self.frames, "local_costmap", now=10.0, keeps_last=True, zones=zones)

    def stand(self, stamp: float) -> None:
        self.frames.add(edge("odom", "base_link", stamp))

    def is_lethal(self, x: float, y: float) -> bool:
        return bool(self.costmap.costmap.grid.at(x, y) == LETHAL)


def with_scans(**source: object) -> Fed:
    scan = {"data_type": "LaserScan", "clearing": True, **source}
    return Fed(("obstacles", "ObstacleLayer"), obstacles={"observation_sources": "scan", "scan": scan})


def scan_at(stamp: float) -> LaserScan:
    angles = np.linspace(-0.5, 0.5, 41)
    return LaserScan(
        stamp=stamp,
        frame_id="base_link",
        angle_min=-0.5,
        angle_increment=0.025,
        range_min=0.1,
        range_max=12.0,
        ranges=WALL / np.cos(angles),
    )


def test_without_a_pose_it_says_so_and_with_one_it_is_current() -> None:
    fed = with_scans()
    assert (fed.costmap.fault, fed.costmap.is_current(10.0)) == (Fault.NEW, False)
    assert fed.costmap.update(10.0) is None
    assert fed.costmap.fault is Fault.NO_POSE
    assert fed.costmap.problem.startswith("no transform from 'base_link' to 'odom'")
    fed.stand(10.1)
    found = fed.costmap.update(10.1)
    assert found is not None
    assert found[0] == Pose2D()
    assert (fed.costmap.fault, fed.costmap.problem, fed.costmap.updates) == (None, "", 1)
    assert fed.costmap.is_current(10.1)


def test_an_old_pose_is_as_none() -> None:
    fed = with_scans()
    fed.stand(10.0)
    assert fed.costmap.update(10.4) is not None
    assert fed.costmap.update(10.6) is None
    assert fed.costmap.problem == "no transform from 'base_link' to 'odom': the newest is 0.60 s old"


def test_a_scan_waits_for_the_transform_of_its_stamp() -> None:
    fed = with_scans(obstacle_range=5.0)
    fed.stand(10.0)
    (scans,) = fed.costmap.scan_inputs
    scans.hear(scan_at(10.1), 10.1)
    fed.costmap.update(10.1)
    assert not fed.is_lethal(WALL + 0.02, 0.0)
    fed.stand(10.2)
    fed.costmap.update(10.2)
    assert fed.is_lethal(WALL + 0.02, 0.0)
    assert not np.array_equal(fed.costmap.last.cells, np.zeros_like(fed.costmap.last.cells))


def test_a_silent_input_is_named() -> None:
    fed = with_scans(expected_update_rate=0.5)
    assert fed.costmap.troubles(10.4) == []
    assert fed.costmap.troubles(10.6) == ["local_costmap/obstacles/scan has been silent for 0.6 s"]


def test_an_update_frequency_of_0_updates_never() -> None:
    fed = Fed(update_frequency=0.0)
    fed.stand(10.0)
    assert fed.costmap.update(10.0) is None
    assert fed.costmap.fault is Fault.NEW


def block() -> Grid:
    """1 x 1 m, a block of 0.2 m in its middle."""
    cells = np.zeros((20, 20), np.int8)
    cells[8:12, 8:12] = 100
    return Grid(GridInfo(resolution=0.05, width=20, height=20, origin_x=-0.5, origin_y=-0.5), cells)


def test_a_map_of_another_frame_lies_where_tf_says() -> None:
    fed = Fed(("map", "StaticLayer"))
    (layer,) = fed.costmap.map_layers
    fed.stand(10.0)
    fed.costmap.hear_map(layer, block(), "map")
    assert fed.costmap.has_map(layer)
    fed.costmap.update(10.0)
    assert "'map'" in fed.costmap.map_problem
    fed.frames.add(edge("odom", "map", 10.1, Pose2D(1.5, 1.0)))
    fed.stand(10.1)
    fed.costmap.update(10.1)
    assert fed.costmap.map_problem == ""
    assert fed.is_lethal(1.5, 1.0)
    assert not fed.is_lethal(0.0, 0.0)


def test_a_mask_from_a_file_is_no_map_of_a_topic(tmp_path: Path) -> None:
    write_map(str(tmp_path / "mask"), block())
    mask = {"mask_file": str(tmp_path / "mask.yaml"), "mask_frame": "odom"}
    fed = Fed(("keepout", "KeepoutLayer"), keepout=mask)
    assert fed.costmap.map_layers == []
    fed.stand(10.0)
    fed.costmap.update(10.0)
    assert fed.is_lethal(0.0, 0.0)
    with pytest.raises(MapError, match="nowhere"):
        Fed(("keepout", "KeepoutLayer"), keepout={"mask_file": str(tmp_path / "nowhere.yaml")})


def square(x: float, y: float) -> str:
    corners = [[x - 0.2, y - 0.2], [x + 0.2, y - 0.2], [x + 0.2, y + 0.2], [x - 0.2, y + 0.2]]
    return f"zones: [{{name: corner, points: {corners}}}]\n"


def test_zones_come_and_go_with_their_file(tmp_path: Path) -> None:
    file = tmp_path / "zones.yaml"
    fed = Fed(("inflation", "InflationLayer"), zones=file, inflation={"inflation_radius": 0.3})
    fed.frames.add(edge("odom", "map", 10.0, Pose2D(0.5, 0.0)))

    def update(at: float) -> None:
        fed.stand(at)
        fed.costmap.update(at)

    update(10.0)
    assert fed.costmap.is_current(10.0)  # nothing to wait for
    file.write_text(square(1.0, 0.0))
    update(10.1)
    assert fed.is_lethal(1.5, 0.0)  # in odom
    assert not fed.is_lethal(1.0, 0.0)
    assert fed.costmap.costmap.grid.at(1.22, 0.0) > 0  # inflated
    file.write_text("zones: [3]")
    update(10.2)
    assert fed.is_lethal(1.5, 0.0)
    assert "the zones before stay" in fed.costmap.zones_problem
    assert any("zones.yaml" in trouble for trouble in fed.costmap.troubles(10.2))
    file.write_text(square(-1.0, 0.0) + "# elsewhere\n")
    update(10.3)
    assert fed.is_lethal(-0.5, 0.0)
    assert not fed.is_lethal(1.5, 0.0)
    file.unlink()
    update(10.4)
    assert not fed.is_lethal(-0.5, 0.0)
    assert fed.costmap.zones_problem == ""
