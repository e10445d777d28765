"""Place and size of a box's object, by depth, lidar and floor."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rosbot_patrol.patrol.intruder.measure import Depth, Lens, View, measure
from rosbot_patrol.patrol.records.inputs import Box

LENS = Lens(fx=554.38, fy=554.38, cx=320.0, cy=240.0, width=640, height=480)
HEIGHT = 0.22  # of the camera [m]


def view_from(x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> View:
    c, s = math.cos(yaw), math.sin(yaw)
    ahead, left = np.array([c, s, 0.0]), np.array([-s, c, 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack((-left, [0.0, 0.0, -1.0], ahead))
    pose[:3, 3] = x, y, HEIGHT
    return View(LENS, pose)


def box_of(view: View, x: float, y: float, low: float = 0.0, high: float = 1.7, width: float = 0.5) -> Box:
    """The box of an upright plate that faces the camera."""
    optical_from_map = np.linalg.inv(view.map_from_optical)
    u, v = [], []
    for z in (low, high):
        p = optical_from_map @ np.array([x, y, z, 1.0])
        u.append(LENS.cx + LENS.fx * p[0] / p[2])
        v.append(LENS.cy + LENS.fy * p[1] / p[2])
    half = width / 2 * LENS.fx / p[2]
    clip = lambda value, most: int(min(max(value, 0), most))  # noqa: E731
    return Box(
        label="person",
        probability=0.9,
        xmin=clip(u[0] - half, 639),
        xmax=clip(u[0] + half, 639),
        ymin=clip(v[1], 479),
        ymax=clip(v[0], 479),
    )


def depth_of(box: Box, metres: float, behind: float = 4.5, share: float = 1.0) -> Depth:
    """Something round in the box, a wall behind it."""
    rows, columns = np.mgrid[0:480, 0:640]
    middle, half = (box.xmin + box.xmax) / 2, (box.xmax - box.xmin) / 2
    aside = (columns - middle) / half
    is_body = (np.abs(aside) < 0.7 * share) & (rows >= box.ymin) & (rows <= box.ymax)
    round_ = metres + 0.15 * aside**2 + 0.05 * np.sin(rows / 15.0)
    return Depth(np.where(is_body, round_, behind).astype(np.float32), LENS)


@pytest.mark.parametrize(("x", "y", "yaw"), [(3.0, 0.5, 0.0), (2.5, -1.0, -0.3), (-3.0, 2.0, 2.5), (4.4, 0.0, 0.1)])
def test_depth_gives_place_and_height(x: float, y: float, yaw: float) -> None:
    view = view_from(yaw=yaw)
    along = x * math.cos(yaw) + y * math.sin(yaw)
    box = box_of(view, x, y, high=1.2)
    m = measure(box, view, depth_of(box, along - 0.12, behind=5.0)).measured
    assert m is not None
    assert m.source == "depth"
    assert math.dist((m.x, m.y), (x, y)) < 0.2
    if box.ymin > 3:
        assert m.top == pytest.approx(1.2, abs=0.1)
    assert m.is_flat is False


def test_what_stands_behind_is_not_the_person() -> None:
    view = view_from()
    box = box_of(view, 3.0, 0.0, high=1.2)
    m = measure(box, view, depth_of(box, 2.9, behind=3.9, share=0.5)).measured
    assert m is not None
    assert m.x == pytest.approx(3.0, abs=0.2)


def test_a_poster_is_flat_whatever_its_slant() -> None:
    view = view_from()
    box = box_of(view, 2.5, 0.3, low=0.3, high=1.1)
    columns = np.mgrid[0:480, 0:640][1]
    slant = 1.0 / (0.42 + 0.0004 * (columns - 320))  # a wall that runs away to the left
    rng = np.random.default_rng(2)
    metres = (slant + 0.0012 * slant**2 * rng.standard_normal(slant.shape)).astype(np.float32)
    m = measure(box, view, Depth(metres, LENS)).measured
    assert m is not None
    assert m.is_flat is True


def test_dark_clothes_before_a_wall_are_no_poster() -> None:
    view = view_from()
    box = box_of(view, 3.0, 0.0, high=1.2)
    depth = depth_of(box, 2.9, behind=3.5)
    depth.metres[depth.metres < 3.4] = np.nan
    m = measure(box, view, depth).measured
    assert m is None or m.is_flat is None


def test_the_lidar_tells_where_depth_does_not() -> None:
    view = view_from(1.0, 1.0, 0.4)
    x, y = 1.0 + 6.5 * math.cos(0.5), 1.0 + 6.5 * math.sin(0.5)
    box = box_of(view, x, y)
    legs = np.array([[x, y], [x + 0.1, y], [x, y + 0.1], [1.0, 3.0], [8.0, 1.0]])
    nothing = Depth(np.full((480, 640), np.nan, np.float32), LENS)
    m = measure(box, view, nothing, legs).measured
    assert m is not None
    assert (m.source, m.is_flat) == ("lidar", None)
    assert math.dist((m.x, m.y), (x, y)) < 0.3


@pytest.mark.parametrize(("known", "source"), [(0.08, "lidar"), (0.5, "depth")])
def test_furniture_before_one_beyond_the_depth_cameras_range_is_not_them(known: float, source: str) -> None:
    view = view_from()
    box = box_of(view, 7.0, 0.0)
    metres = np.full((480, 640), np.nan, np.float32)
    metres[:, round(box.xmax - (0.25 + 0.5 * known) * box.width) :] = 3.6
    legs = np.array([[6.9, -0.1], [6.9, -0.08], [6.95, 0.1], [6.9, 0.12]])
    m = measure(box, view, Depth(metres, LENS), legs).measured
    assert m is not None
    assert m.source == source
    assert m.x == pytest.approx(7.0 if source == "lidar" else 3.7, abs=0.1)
    assert measure(box, view, Depth(metres, LENS)).measured.source == "depth"  # nothing tells more


def test_the_floor_tells_last_and_says_that_it_is_less_sure() -> None:
    view = view_from()
    box = box_of(view, 3.0, 0.2)
    m = measure(box, view, None, np.empty((0, 2))).measured
    assert m is not None
    assert m.source == "floor"
    assert m.x == pytest.approx(3.0, abs=0.4)
    assert m.error > 0.6  # so that suspects do not take it


def test_a_box_that_ends_below_the_feet_is_where_depth_says() -> None:
    """The lower edges of yolo-fastest's boxes are off by up to a tenth of the height."""
    view = view_from()
    box = box_of(view, 4.0, 0.0)
    depth = depth_of(box, 3.88, behind=6.0)
    depth.metres[box.ymax - 10 :, :] = 2.8  # a chair before the feet
    low = replace(box, ymax=box.ymax + round(0.09 * box.height))
    m = measure(low, view, depth).measured
    assert m is not None
    assert (m.source, m.x) == ("depth", pytest.approx(4.0, abs=0.15))


def test_a_box_without_feet_has_no_place() -> None:
    view = view_from()
    box = Box(label="person", probability=0.9, xmin=200, ymin=0, xmax=400, ymax=479)
    assert measure(box, view).measured is None
    above = Box(label="person", probability=0.9, xmin=200, ymin=20, xmax=400, ymax=200)  # over the horizon
    assert measure(above, view).measured is None


def leg_before_a_wall(box: Box, leg: float, wall: float, share: float = 0.4) -> Depth:
    """A leg at the left edge of a box, a wall beside it."""
    metres = np.full((480, 640), wall, np.float32)
    metres[box.ymin : box.ymax, box.xmin : box.xmin + int(share * box.width)] = leg
    return Depth(metres, LENS)


@pytest.mark.parametrize("leg", [1.05, math.nan])  # NaN: black trousers
def test_the_wall_that_shows_beside_a_leg_is_not_the_leg(leg: float) -> None:
    view = view_from()
    box = Box(label="person", probability=0.9, xmin=10, ymin=0, xmax=129, ymax=370)
    m = measure(box, view, leg_before_a_wall(box, leg, wall=2.6)).measured
    assert m is not None
    assert m.source == ("floor" if math.isnan(leg) else "depth")
    assert m.away == pytest.approx(1.25, abs=0.2)
    assert m.error < 0.35
    assert m.top < 0.8  # so that it counts as too near to be told from a pet
    assert m.is_flat is not True


def test_a_box_that_begins_about_the_upper_edge_may_go_on_above_it() -> None:
    for ymin, is_cut in ((14, True), (40, False)):
        box = Box(label="person", probability=0.9, xmin=100, ymin=ymin, xmax=200, ymax=350)
        m = measure(box, view_from(), depth_of(box, 1.2)).measured
        assert m is not None
        assert m.is_cut == is_cut


def test_legs_right_before_the_camera_go_on_above_a_box_that_begins_far_below_the_edge() -> None:
    near = Box(label="person", probability=0.9, xmin=100, ymin=40, xmax=260, ymax=479)
    m = measure(near, view_from(), depth_of(near, 0.55)).measured
    assert m is not None
    assert m.is_cut_above
    dog = Box(label="person", probability=0.9, xmin=100, ymin=70, xmax=260, ymax=350)
    m = measure(dog, view_from(), depth_of(dog, 1.0)).measured
    assert m is not None
    assert not m.is_cut_above


@pytest.mark.parametrize(("left", "known"), [(300, True), (580, False)])  # 639 is the picture's right edge
def test_what_goes_straight_up_is_of_a_person_only_where_the_picture_shows_both_sides(left: int, known: bool) -> None:
    view = view_from()
    leg = Box(label="person", probability=0.9, xmin=left, ymin=0, xmax=left + 59, ymax=335)
    aside = -1.1 * (left + 30 - 320) / 554.0
    lidar = np.array([[1.1, aside - 0.03], [1.1, aside], [1.1, aside + 0.03]])
    m = measure(leg, view, depth_of(leg, 1.1), lidar).measured
    assert m is not None
    assert m.is_cut_above
    assert (m.has_legs is not None) == known


def test_a_leg_too_near_to_be_measured_stands_beneath_the_picture() -> None:
    view = view_from()
    box = Box(label="person", probability=0.9, xmin=100, ymin=0, xmax=400, ymax=479)
    m = measure(box, view, leg_before_a_wall(box, math.nan, wall=3.0, share=0.6)).measured
    assert m is not None
    assert m.source == "floor"
    assert m.away < 0.8
    legs = np.array([[2.9, 0.0], [2.95, 0.05], [2.9, 0.1]])  # of a chair behind
    again = measure(box, view, leg_before_a_wall(box, math.nan, wall=3.0, share=0.6), legs).measured
    assert again == m


def test_somebody_whose_feet_furniture_hides_is_where_depth_says() -> None:
    view = view_from()
    box = box_of(view, 2.5, 0.0, low=0.5, high=1.2)
    m = measure(box, view, depth_of(box, 2.4)).measured
    assert m is not None
    assert m.source == "depth"
    assert m.x == pytest.approx(2.5, abs=0.15)


def test_somebody_who_comes_into_view_is_where_the_leg_is_and_not_the_wall() -> None:
    view = view_from()
    box = Box(label="person", probability=0.9, xmin=0, ymin=5, xmax=90, ymax=283)
    metres = np.full((480, 640), 5.0, np.float32)
    metres[90:283, :18] = 3.0  # a leg, behind which the box is empty
    m = measure(box, view, Depth(metres, LENS)).measured
    assert m is not None
    assert m.away == pytest.approx(3.5, abs=0.3)  # along its bearing
    assert m.source == "depth"


def test_a_poster_behind_a_sofas_arm_is_flat_and_somebody_there_is_not() -> None:
    view = view_from()
    box = Box(label="person", probability=0.9, xmin=370, ymin=13, xmax=420, ymax=250)
    rows, columns = np.mgrid[0:480, 0:640]
    wall = (4.2 + 0.002 * (columns - 320)).astype(np.float32)
    sofa = (rows > 150) & (columns > 400)
    poster = np.where(sofa, 2.6, wall).astype(np.float32)
    assert measure(box, view, Depth(poster, LENS)).measured.is_flat is True
    aside = np.abs((columns - 395) / 25.0)
    body = np.where((aside < 0.6) & (rows > 20), 3.6 + 0.2 * aside**2, wall)
    somebody = np.where(sofa, 2.6, body).astype(np.float32)
    assert measure(box, view, Depth(somebody, LENS)).measured.is_flat is False


def scene(box: Box, wall: float, body: float = 0.0, chair: tuple[float, float, float] | None = None) -> Depth:
    """A wall, where `body` is given somebody before it who fills the box, and a chair's back before a part of both.

    Args:
        box: of the person, or of their picture on the wall.
        wall: [m]; body: [m].
        chair: where in the box it begins and ends, from left to right, and how far it is [m].
    """
    rows, columns = np.mgrid[0:480, 0:640]
    aside = (columns - (box.xmin + box.xmax) / 2) / (box.width / 2)
    metres = wall + 0.01 * np.random.default_rng(1).standard_normal(rows.shape)
    if body:
        is_body = (np.abs(aside) < 0.9) & (rows >= box.ymin) & (rows <= box.ymax)
        metres = np.where(is_body, body + 0.2 * aside**2, metres)
    if chair:
        along = (columns - box.xmin) / box.width
        is_chair = (along > chair[0]) & (along < chair[1]) & (rows > 0.2 * box.height)
        metres = np.where(is_chair, chair[2] + 0.3 * (along - chair[0]), metres)
    return Depth(metres.astype(np.float32), LENS)


@pytest.mark.parametrize("chair", [(0.6, 1.3, 1.8), (-0.5, 0.65, 1.5), (0.3, 0.65, 1.8)])
def test_a_poster_half_behind_a_chair_is_flat_and_where_the_wall_is(chair: tuple[float, float, float]) -> None:
    view = view_from()
    for box in (box_of(view, 2.7, 0.3, low=0.4, high=1.2), box_of(view, 2.7, 0.3, low=0.4, high=1.0)):
        m = measure(box, view, scene(box, 2.7, chair=chair)).measured
        assert m is not None
        assert m.is_flat is True
        assert m.x == pytest.approx(2.82, abs=0.1)


@pytest.mark.parametrize("chair", [(0.6, 1.3, 1.8), (-0.5, 0.4, 1.5)])
def test_somebody_half_behind_a_chair_is_behind_it_and_no_poster(chair: tuple[float, float, float]) -> None:
    view = view_from()
    box = box_of(view, 3.0, 0.3, low=0.0, high=1.2)
    m = measure(box, view, scene(box, 4.0, body=2.88, chair=chair)).measured
    assert m is not None
    assert m.is_flat is not True
    assert m.x == pytest.approx(3.1, abs=0.2)


def test_somebody_beside_whom_a_chair_stands_is_not_the_chair() -> None:
    view = view_from()
    box = box_of(view, 3.0, 0.3, low=0.0, high=1.2)
    m = measure(box, view, scene(box, 4.0, body=2.88, chair=(0.8, 1.3, 1.8))).measured
    assert m is not None
    assert m.x == pytest.approx(3.1, abs=0.2)


def test_somebody_before_what_cannot_be_measured_is_no_poster() -> None:
    """As far off as 4.4 m a body's depths lie in one plane, within their noise."""
    view = view_from()
    box = box_of(view, 4.5, 0.0, high=1.2)
    depth = depth_of(box, 4.4)
    aside = np.abs(np.arange(640) - (box.xmin + box.xmax) / 2) / (box.width / 2)
    depth.metres[:, aside > 0.7] = np.nan
    m = measure(box, view, depth).measured
    assert m is not None
    assert m.is_flat is None


@pytest.mark.parametrize(("xmin", "xmax", "is_part"), [(0, 90, True), (550, 638, True), (10, 600, False)])
def test_a_box_at_the_pictures_edge_is_of_a_part(xmin: int, xmax: int, is_part: bool) -> None:
    box = Box(label="person", probability=0.9, xmin=xmin, xmax=xmax, ymin=60, ymax=400)
    measured = measure(box, view_from(), depth_of(box, 2.0)).measured
    assert measured is not None
    assert measured.is_cut_aside == is_part


def test_a_box_without_width_is_left_alone() -> None:
    box = Box(label="person", probability=0.9, xmin=200, ymin=20, xmax=200, ymax=20)
    assert measure(box, view_from(), Depth(np.ones((480, 640), np.float32), LENS)) == box


def test_a_depth_camera_of_another_size_is_looked_up_by_bearing() -> None:
    view = view_from()
    box = box_of(view, 3.0, 0.5, high=1.2)
    whole = depth_of(box, 2.88)
    half = Depth(whole.metres[::2, ::2], Lens(fx=277.19, fy=277.19, cx=160.0, cy=120.0, width=320, height=240))
    m = measure(box, view, half).measured
    assert m is not None
    assert math.dist((m.x, m.y), (3.0, 0.5)) < 0.2


def test_the_lens_tells_how_wide_it_looks() -> None:
    assert LENS.view_width == pytest.approx(1.047, abs=0.002)
    assert view_from(yaw=1.2).yaw == pytest.approx(1.2)


LEGS = np.array([[4.9, -0.1], [4.9, -0.08], [4.95, 0.1], [4.9, 0.12]])


def far_behind_a_desk(box: Box, desk: float, *, upper: float = 0.0, seen: float = 1.0) -> Depth:
    """Somebody 4.9 m off before what is beyond the depth camera's range, a desk at 3.5 m before them.

    Args:
        box: of the person.
        desk: how much of the box it takes, from below.
        upper: and of the rows above it, by a screen on it at the right.
        seen: of the body depth is known, the rest is dark.
    """
    rows, columns = np.mgrid[0:480, 0:640]
    aside = (columns - (box.xmin + box.xmax) / 2) / (box.width / 2)
    down = (rows - box.ymin) / box.height
    known = np.random.default_rng(2).random(rows.shape) < seen
    metres = np.where((np.abs(aside) < 0.45) & (down > 0) & known, 4.9 + 0.1 * aside**2, np.nan)
    metres[(down > 1.0 - desk) | (aside > 1.0 - 2.0 * upper)] = 3.5
    return Depth(metres.astype(np.float32), LENS)


@pytest.mark.parametrize("seen", [1.0, 0.5])
def test_a_desk_before_somebody_at_the_end_of_the_depth_cameras_range_is_not_them(seen: float) -> None:
    """In a campaign: people in the flat's study were told to be at the desk before them, 1.1 and 1.3 m off."""
    view = view_from()
    box = box_of(view, 5.0, 0.0)
    m = measure(box, view, far_behind_a_desk(box, 0.45, seen=seen)).measured
    assert m is not None
    assert m.source == "depth"
    assert m.x == pytest.approx(5.0, abs=0.15)


def test_legs_farther_off_are_of_one_whose_upper_part_is_as_far() -> None:
    view = view_from()
    box = box_of(view, 5.0, 0.0)
    depth = far_behind_a_desk(box, 0.6, upper=0.11)
    assert measure(box, view, depth).measured.x == pytest.approx(3.6, abs=0.1)  # nothing tells more
    m = measure(box, view, depth, LEGS).measured
    assert m is not None
    assert m.source == "lidar"
    assert m.x == pytest.approx(5.0, abs=0.15)
    near = measure(box, view, far_behind_a_desk(box, 1.2), LEGS).measured  # somebody else's legs: all of it is nearer
    assert near is not None
    assert near.x == pytest.approx(3.6, abs=0.1)


def test_a_table_leg_is_not_that_of_somebody_whom_depth_and_lidar_put_farther_off() -> None:
    view = view_from()
    box = replace(box_of(view, 3.6, 0.0), ymin=60)
    rows, columns = np.mgrid[0:480, 0:640]
    metres = np.full((480, 640), 4.9, np.float32)
    metres[(columns < box.xmin + 0.1 * box.width) & (rows > box.ymin)] = 3.5
    m = measure(box, view, Depth(metres, LENS), LEGS).measured
    assert m is not None
    assert m.x == pytest.approx(5.0, abs=0.15)
    assert measure(box, view, Depth(metres, LENS)).measured.x == pytest.approx(3.6, abs=0.1)  # nothing tells more
