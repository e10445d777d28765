"""What a depth camera marks and clears: low things on the floor, seen once and kept until it looks there again."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest

from rosbot_patrol.costmap.costs import LETHAL
from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.costmap.sensor_params import DepthSourceParams, SourceParams
from rosbot_patrol.costmap.sources.cloud import CloudLayout, cloud_points, observe_cloud
from rosbot_patrol.costmap.sources.depth import DepthPicture, Optics, observe_depth
from rosbot_patrol.costmap.sources.observation import Observation
from rosbot_patrol.errors import ImageError, ParamError
from rosbot_patrol.geometry import Pose2D

OPTICS = Optics(554.38, 554.38, 319.5, 239.5)
EYE = 0.22  # of the camera above the floor [m]
AXLES = 0.04  # of the costmap's frame above the floor [m]
FROM_OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # x ahead, y left, z up
STAR = (1.5, 1.56, -0.3, 0.3, 0.035, 0.085)  # an arm of a chair's base: x, y, z from and to, of the floor
WALL = (2.8, 3.0, -3.0, 3.0, 0.0, 2.0)


def camera_at(pose=None, pitch=0.0):
    """costmap_from_optical, shape (4, 4); pitch is down."""
    x, y, yaw = pose or Pose2D()
    c, s, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]) @ np.array([[cp, 0, sp], [0, 1.0, 0], [-sp, 0, cp]])
    matrix = np.eye(4)
    matrix[:3, :3] = turned @ FROM_OPTICAL
    matrix[:3, 3] = x, y, EYE - AXLES
    return matrix


def take(boxes, pose=None, *, noise=0.0, seed=1, pitch=0.0, nearest=0.4, farthest=5.0):
    """A depth picture of the floor and boxes (x, y, z from and to), as the simulated camera takes it."""
    matrix = camera_at(pose, pitch)
    eye = matrix[:3, 3] + (0.0, 0.0, AXLES)
    v, u = np.mgrid[0:480, 0:640]
    rays = np.stack(((u - OPTICS.cx) / OPTICS.fx, (v - OPTICS.cy) / OPTICS.fy, np.ones(u.shape)), axis=-1)
    rays = rays @ matrix[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(rays[..., 2] < 0.0, -eye[2] / rays[..., 2], np.inf)
        for x0, x1, y0, y1, z0, z1 in boxes:
            a = (np.array([x0, y0, z0]) - eye) / rays
            b = (np.array([x1, y1, z1]) - eye) / rays
            enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
            depth = np.where((enter <= leave) & (enter > 0.0), np.minimum(depth, enter), depth)
    depth = np.where((depth < nearest) | (depth > farthest), np.nan, depth)
    depth = depth + np.random.default_rng(seed).standard_normal(depth.shape) * noise * depth**2
    return depth.astype(np.float32)


def params(**changes):
    values = {"obstacle_range": 2.5, "raytrace_range": 3.0, "floor_height": -AXLES, "clearing": True, **changes}
    return DepthSourceParams(**values)


def look(boxes, pose=None, *, noise=0.0, seed=1, pitch=0.0, stamp=0.0, **changes):
    picture = DepthPicture.of(take(boxes, pose, noise=noise, seed=seed, pitch=pitch), OPTICS, stride=4, stamp=stamp)
    return observe_depth(picture, camera_at(pose), params(**changes))


def make(layers=None, **changes):
    """A costmap with a lidar's layer and one for the camera."""
    depth = {"clearing": True, "floor_height": -AXLES, "obstacle_range": 2.5, **changes}
    tree = {
        "plugins": [
            {"name": "lidar", "type": "costmap_2d::ObstacleLayer"},
            {"name": "low", "type": "costmap_2d::ObstacleLayer"},
        ],
        "lidar": {"observation_sources": "scan", "scan": {"data_type": "LaserScan", "clearing": True}},
        "low": {"depth_sources": "depth", "depth": depth, **(layers or {})},
        "rolling_window": True,
        "width": 6.0,
        "height": 6.0,
        "resolution": 0.05,
        "footprint": [[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]],
    }
    return LayeredCostmap(read_costmap(tree))


def see(costmap, boxes, pose=None, *, now=0.0):
    layer = costmap.obstacle_layers[1]
    buffer = layer.buffers["depth"]
    picture = DepthPicture.of(take(boxes, pose), OPTICS, stride=4, stamp=now)
    buffer.add(observe_depth(picture, camera_at(pose), buffer.params))
    costmap.update(now, pose or Pose2D())


def marks(costmap):
    """Middles of the lethal cells, shape (N, 2)."""
    iy, ix = np.nonzero(costmap.cells == LETHAL)
    info = costmap.info
    return np.column_stack((ix + 0.5, iy + 0.5)) * info.resolution + (info.origin_x, info.origin_y)


def test_the_floor_is_no_obstacle_for_a_noisy_camera():
    for seed in range(5):
        assert len(look([], noise=0.0012, seed=seed).hits) == 0


def test_the_floor_is_none_for_a_camera_that_nods_by_half_a_degree():
    for pitch in (-0.0087, 0.0087):
        assert len(look([], noise=0.0012, pitch=pitch).hits) == 0


def test_a_chairs_arm_under_the_lidars_plane_is_seen_where_it_is():
    hits = look([STAR, WALL], noise=0.0012, lidar_height=0.158).hits
    near = hits[hits[:, 0] < 2.5]
    assert len(near) >= 10
    assert abs(near[:, 0] - 1.53).max() < 0.05
    assert near[:, 1].min() < -0.25
    assert near[:, 1].max() > 0.25


def test_what_the_lidar_sees_is_left_to_it():
    box = (1.5, 1.7, -0.3, 0.3, 0.0, 0.4)
    assert len(look([box], lidar_height=0.158).hits) == 0
    assert len(look([box]).hits) > 5


def test_what_stands_out_far_from_what_the_lidar_sees_is_marked():
    post, arm = (1.5, 1.56, -0.03, 0.03, 0.0, 0.5), (1.5, 1.56, -0.3, 0.3, 0.035, 0.085)
    hits = look([post, arm], lidar_height=0.158, lidar_reach=0.1).hits
    assert abs(hits[:, 1]).min() > 0.1
    assert len(hits) >= 4


def test_a_table_top_at_the_robots_height_is_seen_and_one_above_is_not():
    assert len(look([(1.5, 2.0, -0.3, 0.3, 0.22, 0.26)], max_obstacle_height=0.3).hits) > 5
    assert len(look([(1.5, 2.0, -0.3, 0.3, 0.35, 0.40)], max_obstacle_height=0.3).hits) == 0


def test_a_single_pixel_is_no_obstacle():
    depth = take([])
    depth[242, 322] = 1.0
    picture = DepthPicture.of(depth, OPTICS, stride=4, stamp=0.0)
    assert len(observe_depth(picture, camera_at(), params()).hits) == 0
    assert len(observe_depth(picture, camera_at(), params(min_points=1)).hits) == 1


def test_a_yawed_camera_marks_in_the_costmaps_frame():
    pose = Pose2D(1.0, 2.0, math.pi / 2)
    box = (0.8, 1.2, 3.5, 3.6, 0.0, 0.08)
    hits = look([box], pose).hits
    assert len(hits) > 3
    assert abs(hits[:, 0] - 1.0).max() < 0.25
    assert abs(hits[:, 1] - 3.5).max() < 0.12


def test_marks_stay_while_the_robot_is_too_near_to_see_them():
    costmap = make()
    for x in np.arange(0.0, 1.3, 0.1):
        see(costmap, [STAR, WALL], Pose2D(float(x), 0.0), now=float(x))
    low = marks(costmap)
    low = low[low[:, 0] < 2.0]
    assert len(low) >= 10
    assert abs(low[:, 0] - 1.53).max() < 0.08


def test_marks_go_when_the_camera_looks_there_again_and_nothing_is_there():
    costmap = make()
    see(costmap, [STAR])
    assert len(marks(costmap)) >= 10
    see(costmap, [], now=0.5)
    assert len(marks(costmap)) == 0


def test_marks_go_when_the_camera_sees_nothing_at_all_behind_their_upper_part():
    costmap = make()
    see(costmap, [(1.5, 1.6, -0.2, 0.2, 0.22, 0.27)])
    assert len(marks(costmap)) > 3
    see(costmap, [], now=0.5)  # above the horizon there is no depth
    assert len(marks(costmap)) == 0


def test_marks_stay_while_something_hides_them_or_the_camera_looks_elsewhere():
    costmap = make()
    see(costmap, [STAR])
    before = len(marks(costmap))
    hidden = marks(costmap)
    see(costmap, [(0.9, 0.92, -0.5, 0.5, 0.0, 0.5)], now=0.5)
    after = {tuple(np.round(m, 3)) for m in marks(costmap)}
    assert {tuple(np.round(m, 3)) for m in hidden} <= after
    see(costmap, [], Pose2D(0.0, 0.0, math.pi), now=1.0)
    assert len(marks(costmap)) >= before


def test_the_lidars_beams_do_not_clear_what_lies_under_them():
    costmap = make()
    see(costmap, [STAR])
    before = len(marks(costmap))
    ends = np.column_stack((np.full(60, 2.0), np.linspace(-1.0, 1.0, 60)))
    costmap.obstacle_layers[0].buffers["scan"].add(
        Observation(stamp=0.5, sensor=(0.0, 0.0), hits=np.empty((0, 2)), ends=ends)
    )
    costmap.update(0.5, Pose2D())
    assert len(marks(costmap)) == before


def test_marks_age_where_that_is_asked_for():
    costmap = make({"forget_out_of_view_after": 10.0})
    see(costmap, [STAR])
    costmap.obstacle_layers[1].buffers["depth"].clear()
    for now in np.arange(1.0, 9.0):
        costmap.update(float(now), Pose2D())
    assert len(marks(costmap)) >= 10
    for now in np.arange(9.0, 13.0):
        costmap.update(float(now), Pose2D())
    assert len(marks(costmap)) == 0


def test_millimetres_are_read_and_zero_is_unknown():
    depth = np.nan_to_num(take([STAR]) * 1000.0).astype(np.uint16)
    picture = DepthPicture.of(depth, OPTICS, stride=4, stamp=0.0)
    assert np.isnan(picture.depth).sum() == (take([STAR])[2::4, 2::4] != take([STAR])[2::4, 2::4]).sum()
    assert len(observe_depth(picture, camera_at(), params()).hits) > 10


def test_only_the_pixels_that_are_used_are_copied():
    depth = take([])
    picture = DepthPicture.of(depth, OPTICS, stride=4, stamp=0.0)
    assert picture.depth.shape == (120, 160)
    assert picture.depth[30, 40] == depth[122, 162] or np.isnan(depth[122, 162])
    assert not np.shares_memory(picture.depth, depth)
    u = (162 - OPTICS.cx) / OPTICS.fx
    assert (40 - picture.optics[2]) / picture.optics[0] == pytest.approx(u)


def test_what_is_no_depth_picture_is_refused():
    for wrong in (np.zeros((4, 4, 3), np.float32), np.zeros((480, 640), np.int8), np.zeros((2, 2), np.float32)):
        with pytest.raises(ImageError, match="no depth picture"):
            DepthPicture.of(wrong, OPTICS, stride=4, stamp=0.0)


def test_parameters_of_a_depth_source_are_checked():
    with pytest.raises(ParamError, match="low/depth/min_points"):
        make(min_points=0)
    assert isinstance(make().obstacle_layers[1].buffers["depth"].params, DepthSourceParams)


# ---- clouds


def layout(width, height, step=16):
    fields = {name: (4 * i, 7) for i, name in enumerate("xyz")}
    return CloudLayout(width, height, fields, step, step * width)


def packed(points, step=16):
    return b"".join(struct.pack("<fff", *p).ljust(step, b"\0") for p in points)


def test_points_of_a_cloud_come_out_and_those_that_are_not_finite_do_not():
    points = [(1.0, 2.0, 3.0), (math.nan, 0.0, 1.0), (4.0, 5.0, 6.0)]
    found = cloud_points(packed(points), layout(3, 1))
    np.testing.assert_allclose(found, [points[0], points[2]])


def test_every_nth_row_and_column_of_a_cloud_is_used():
    points = [(x, y, 0.0) for y in range(8) for x in range(12)]
    found = cloud_points(packed(points), layout(12, 8), stride=4)
    np.testing.assert_allclose(found, [(x, y, 0.0) for y in (2, 6) for x in (2, 6, 10)])


def test_a_cloud_without_coordinates_or_bytes_is_refused():
    with pytest.raises(ImageError, match="without floats z"):
        cloud_points(b"", CloudLayout(0, 0, {"x": (0, 7), "y": (4, 7)}, 16, 0))
    with pytest.raises(ImageError, match="16 bytes, expected 32 x 1"):
        cloud_points(b"\0" * 16, layout(2, 1))


def test_points_of_a_cloud_count_between_the_sources_heights_as_upstream():
    source = SourceParams(data_type="PointCloud2", min_obstacle_height=0.05, max_obstacle_height=0.5)
    points = np.array([[0.0, 0.0, 1.0], [0.0, 0.1, 1.0], [0.0, 0.17, 1.0], [0.0, -0.5, 1.0]])
    seen = observe_cloud(points, camera_at(Pose2D(1.0, 0.0)), source, stamp=3.0, top=0.1)
    # heights in the costmap's frame: 0.18, 0.08, 0.01, 0.68
    np.testing.assert_allclose(seen.ends, [[2.0, 0.0], [2.0, 0.0]])
    np.testing.assert_allclose(seen.hits, [[2.0, 0.0]])
    assert seen.sensor == (1.0, 0.0)


def test_a_cloud_marks_and_clears_as_scans_do():
    costmap = make()
    layer = costmap.obstacle_layers[0]
    buffer = layer.buffers["scan"]
    for x, now in ((1.0, 0.0), (2.0, 0.1)):
        cloud = np.array([[0.0, 0.05, x]])
        buffer.add(observe_cloud(cloud, camera_at(), SourceParams(data_type="PointCloud2"), stamp=now, top=2.0))
        costmap.update(now, Pose2D())
    np.testing.assert_allclose(marks(costmap), [[2.025, 0.025]], atol=0.03)
