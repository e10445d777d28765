"""Topics of a costmap, without a master: what is decoded, when it waits, and what is said of bad and silent ones."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, Range
from sensor_msgs.msg import LaserScan as LaserScanMsg

from rosbot_patrol.costmap.costs import LETHAL
from rosbot_patrol.costmap.fed import FedCostmap
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import TransformError
from rosbot_patrol.geometry import Pose2D, Transform
from rosbot_patrol.ros.messages.convert import scan_to_msg
from rosbot_patrol.ros.move_base import sources as costmap_sources
from rosbot_patrol.ros.simulator import messages
from rosbot_patrol.scan import LaserScan
from rosbot_patrol.simulation.sensors.camera import CameraParams
from rosbot_patrol.simulation.sensors.range_sensors import RangeParams

CAMERA = CameraParams().intrinsics
EYE = 0.18  # of the camera above base_link [m]


class Topics:
    """Stands in for rospy: topics by name, and a clock."""

    def __init__(self, monkeypatch) -> None:
        self.callbacks: dict[str, list] = {}
        self.time = 100.0
        monkeypatch.setattr(costmap_sources.rospy, "Subscriber", self._subscribe)
        monkeypatch.setattr(costmap_sources, "now", lambda: self.time)

    def _subscribe(self, topic, kind, callback, **_):
        topics = self

        class Subscription:
            def unregister(self):
                topics.callbacks[topic].remove(callback)

        self.callbacks.setdefault(topic, []).append(callback)
        assert kind in (Image, CameraInfo, PointCloud2, Range, LaserScanMsg)
        return Subscription()

    def send(self, topic, msg):
        for callback in list(self.callbacks[topic]):
            callback(msg)


class Frames:
    """Stands in for tf: the camera looks ahead from the base, which stands at the origin."""

    def __init__(self) -> None:
        self.known_until = 1e9

    def _check(self, stamp):
        if stamp > self.known_until:
            raise TransformError("odom", "camera_depth_frame", "not yet")

    laser = Transform(0.1, 0.0, 0.2)
    camera = Transform(0.0, 0.0, EYE, -0.5, 0.5, -0.5, 0.5)  # x right, y down, z ahead

    def lookup(self, target, source, stamp):
        del target, source
        self._check(stamp)
        return Pose2D(0.1, 0.0, 0.0)

    def transform(self, target, source, stamp):
        del target
        self._check(stamp)
        return {"laser": self.laser, "camera_depth_frame": self.camera}[source]


@pytest.fixture
def topics(monkeypatch):
    return Topics(monkeypatch)


def subscribed(tree):
    """A costmap and its inputs, behind their topics."""
    fed = FedCostmap(read_costmap(tree), Frames(), "local_costmap", now=100.0)
    costmap_sources.subscribe_inputs(fed)
    return fed.costmap, fed.inputs


def make(**depth):
    tree = {
        "plugins": [
            {"name": "low", "type": "costmap_2d::ObstacleLayer"},
            {"name": "ranges", "type": "range_sensor_layer::RangeSensorLayer"},
        ],
        "low": {
            "depth_sources": "depth",
            "depth": {
                "topic": "camera/depth/image_raw",
                "floor_height": -0.04,
                "clearing": True,
                "expected_update_rate": 1.0,
                **depth,
            },
        },
        "ranges": {"topics": ["/range/fl"]},
        "rolling_window": True,
        "width": 6.0,
        "height": 6.0,
        "resolution": 0.05,
        "footprint": [[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]],
    }
    return subscribed(tree)


def picture(stamp, *, encoding="32FC1"):
    """A bar 1.5 m ahead, 0.1 m high, on the floor; nothing else."""
    depth = np.full((480, 640), np.nan, np.float32)
    top = CAMERA.cy + CAMERA.fy * (EYE + 0.04 - 0.1) / 1.5
    low = CAMERA.cy + CAMERA.fy * (EYE + 0.04 - 0.03) / 1.5
    depth[int(top) : int(low), 220:420] = 1.5
    if encoding == "16UC1":
        depth = np.nan_to_num(depth * 1000.0).astype(np.uint16)
    return messages.image_msg(depth, encoding, stamp, "camera_depth_frame")


def info(stamp=100.0):
    return messages.camera_info_msg(CAMERA, stamp, "camera_depth_frame")


def update(costmap, sources, frames, now):
    for source in sources:
        source.take(frames, "odom", now)
    costmap.update(now, Pose2D())
    return int((costmap.cells == LETHAL).sum())


@pytest.mark.parametrize("encoding", ["32FC1", "16UC1"])
def test_a_depth_picture_marks(topics, encoding):
    costmap, sources = make()
    topics.send("camera/depth/camera_info", info())
    topics.send("camera/depth/image_raw", picture(100.0, encoding=encoding))
    assert update(costmap, sources, Frames(), 100.0) >= 8
    assert costmap.grid.at(1.52, 0.02) == LETHAL
    assert topics.callbacks["camera/depth/camera_info"] == []  # heard once


def test_a_picture_waits_for_its_transform(topics):
    costmap, sources = make()
    frames = Frames()
    frames.known_until = 99.9
    topics.send("camera/depth/camera_info", info())
    topics.send("camera/depth/image_raw", picture(100.0))
    assert update(costmap, sources, frames, 100.0) == 0
    frames.known_until = 101.0
    assert update(costmap, sources, frames, 100.1) >= 8


def test_pictures_come_no_faster_than_asked_for(topics):
    _, sources = make(max_rate=2.0)
    topics.send("camera/depth/camera_info", info())
    used = []
    for k in range(20):
        topics.send("camera/depth/image_raw", picture(100.0 + 0.1 * k))
        used += [entry.stamp for entry in sources[0]._waiting]
        sources[0]._waiting.clear()
    assert np.diff(used) == pytest.approx([0.5, 0.5, 0.5])


def test_without_camera_info_it_is_said_what_is_missing(topics):
    _, sources = make()
    topics.send("camera/depth/image_raw", picture(100.0))
    assert sources[0].trouble(100.0) == ""  # it may be about to come
    topics.time = 106.0
    topics.send("camera/depth/image_raw", picture(106.0))
    assert "needs its camera/depth/camera_info, none has come" in sources[0].trouble(106.0)


def test_a_camera_that_changes_its_size_is_asked_anew(topics):
    costmap, sources = make()
    other = info()
    other.width, other.height = 320, 240
    topics.send("camera/depth/camera_info", other)
    topics.send("camera/depth/image_raw", picture(100.0))
    assert "it tells of 320 x 240 pixels" in sources[0].trouble(100.0)
    topics.send("camera/depth/camera_info", info())
    topics.send("camera/depth/image_raw", picture(100.1))
    assert sources[0].trouble(100.1) == ""
    assert update(costmap, sources, Frames(), 100.1) >= 8


def test_a_colour_picture_is_refused_in_words(topics):
    _, sources = make()
    topics.send("camera/depth/camera_info", info())
    colour = messages.image_msg(np.zeros((480, 640, 3), np.uint8), "rgb8", 100.0, "camera_depth_frame")
    topics.send("camera/depth/image_raw", colour)
    assert "pictures are rgb8, expected depth" in sources[0].trouble(100.0)


def test_silent_sources_are_named(topics):
    _, sources = make()
    assert [source.trouble(101.5) for source in sources] == ["low/depth has been silent for 1.5 s", ""]
    assert sources[1].trouble(110.0) == "ranges/range/fl has been silent for 10.0 s"


def test_range_readings_reach_their_layer(topics):
    costmap, sources = make()
    for k in range(3):
        topics.send("/range/fl", messages.range_msg(0.4, RangeParams(), 100.0 + 0.2 * k, "range_fl"))
        update(costmap, sources, Frames(), 100.0 + 0.2 * k)
    assert costmap.grid.at(0.52, 0.02) == LETHAL


def test_range_readings_that_name_no_frame_are_refused_in_words(topics):
    costmap, sources = make()
    for frame in ("", "/"):
        topics.send("/range/fl", messages.range_msg(0.4, RangeParams(), 100.0, frame))
        assert "ranges/range/fl: its messages name no frame: set header.frame_id" in sources[1].trouble(100.0)
    update(costmap, sources, Frames(), 100.0)
    assert costmap.grid.at(0.52, 0.02) != LETHAL
    topics.send("/range/fl", messages.range_msg(0.4, RangeParams(), 100.2, "range_fl"))
    assert sources[1].trouble(100.2) == ""


def test_a_cloud_marks(topics):
    source = {"data_type": "PointCloud2", "topic": "points"}
    tree = {
        "plugins": [{"name": "cloud", "type": "costmap_2d::ObstacleLayer"}],
        "cloud": {"observation_sources": "points", "points": source},
        "rolling_window": True,
        "width": 6.0,
        "height": 6.0,
        "resolution": 0.05,
        "robot_radius": 0.2,
    }
    costmap, sources = subscribed(tree)
    depth = np.full((480, 640), np.nan, np.float32)
    depth[242, 322] = 1.5
    cloud = messages.cloud_msg(np.zeros((480, 640, 3), np.uint8), depth, CAMERA, 100.0, "camera_depth_frame")
    topics.send("points", cloud)
    assert update(costmap, sources, Frames(), 100.0) == 1
    assert costmap.grid.at(1.52, 0.0) == LETHAL or costmap.grid.at(1.5, -0.02) == LETHAL


# ---- scans


def make_scans(**source):
    tree = {
        "plugins": [{"name": "obstacles", "type": "costmap_2d::ObstacleLayer"}],
        "obstacles": {
            "observation_sources": "laser",
            "laser": {"data_type": "LaserScan", "topic": "scan", "clearing": True, "inf_is_valid": True, **source},
        },
        "rolling_window": True,
        "width": 6.0,
        "height": 6.0,
        "resolution": 0.05,
        "footprint": [[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]],
    }
    return subscribed(tree)


def scan(stamp, **changes):
    """A post 1 m ahead on the left of a laser that looks ahead; else nothing."""
    angles = -np.pi + np.pi / 180.0 * np.arange(360)
    values = {
        "stamp": stamp,
        "frame_id": "laser",
        "angle_min": -np.pi,
        "angle_increment": np.pi / 180.0,
        "range_min": 0.1,
        "range_max": 12.0,
        "ranges": np.where(np.abs(angles - 0.5) < 0.06, 1.0, np.inf),
    }
    return scan_to_msg(LaserScan(**{**values, **changes}))


LEFT, RIGHT = (0.1 + np.cos(0.5), np.sin(0.5)), (0.1 + np.cos(0.5), -np.sin(0.5))


@pytest.mark.parametrize("limit", [12.0, np.inf, 3.4028234663852886e38])
@pytest.mark.parametrize(("laser", "there"), [((0.0, 0.0, 0.0, 1.0), LEFT), ((1.0, 0.0, 0.0, 0.0), RIGHT)])
def test_a_scan_marks_on_the_side_where_the_thing_stands(topics, limit, laser, there):
    costmap, sources = make_scans()
    frames = Frames()
    frames.laser = Transform(0.1, 0.0, 0.2, *laser)
    topics.send("scan", scan(100.0, range_max=limit))
    assert 3 <= update(costmap, sources, frames, 100.0) <= 12
    iy, ix = np.nonzero(costmap.cells == LETHAL)
    place = costmap.info.origin_x + (ix.mean() + 0.5) * 0.05, costmap.info.origin_y + (iy.mean() + 0.5) * 0.05
    assert place == pytest.approx(there, abs=0.06)


@pytest.mark.parametrize("limit", [0.0, 0.5])
def test_scans_that_say_nothing_stop_the_robot_and_are_named(topics, caplog, limit):
    costmap, (source,) = make_scans(expected_update_rate=limit)
    frames = Frames()
    topics.send("scan", scan(100.0))
    update(costmap, [source], frames, 100.0)
    for k in range(1, 20):
        topics.time = 100.0 + 0.1 * k
        topics.send("scan", scan(topics.time, ranges=np.zeros(360)))
        update(costmap, [source], frames, topics.time)
        assert source.is_blind(topics.time) == (0.1 * k > (limit or 1.0))
    assert "say nothing" in source.trouble(topics.time)
    assert len([record for record in caplog.records if "say nothing" in record.getMessage()]) == 1
    topics.send("scan", scan(topics.time))
    update(costmap, [source], frames, topics.time)
    assert (source.is_blind(topics.time), source.trouble(topics.time)) == (False, "")


def test_a_tilted_laser_and_one_too_low_stop_the_robot_and_are_named(topics):
    for laser, named in (
        (Transform(0.0, 0.0, 0.2, 0.5, 0.0, 0.0, 0.75**0.5), "the laser 'laser' is tilted by 60 deg in 'odom'"),
        (Transform(0.0, 0.0, -0.05), "min_obstacle_height"),
    ):
        costmap, (source,) = make_scans()
        frames = Frames()
        frames.laser = laser
        topics.send("scan", scan(100.0))
        assert update(costmap, [source], frames, 100.0) == 0
        assert source.is_blind(100.0)
        assert named in source.trouble(100.0)


def test_scans_that_find_no_place_are_named(topics):
    costmap, (source,) = make_scans(expected_update_rate=0.5)
    frames = Frames()
    frames.known_until = 99.0
    for k in range(10):
        topics.time = 100.0 + 0.1 * k
        topics.send("scan", scan(topics.time))
        update(costmap, [source], frames, topics.time)
    assert "cannot be placed: no transform" in source.trouble(topics.time)
