"""Every local planner by its name, on small costmaps and in a closed loop: where it drives, and what it refuses."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import ControlError, ParamError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D, wrap_angle
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.planning.global_planners.navfn import with_headings
from rosbot_patrol.planning.interfaces import LocalView
from rosbot_patrol.planning.registry import DWA, LOCAL_PLANNERS, TRAJECTORY, TUNABLE, make_local_planner, short_name

CORNERS = np.array([[0.12, 0.14], [0.12, -0.14], [-0.12, -0.14], [-0.12, 0.14]])
INFO = GridInfo(resolution=0.05, width=100, height=100, origin_x=-2.5, origin_y=-2.5)
DT = 0.1
TOP, TOP_TURN, ACC, ACC_TURN, NEAR, TURNED = 0.36, 1.5, 1.0, 4.0, 0.08, 0.1
SLOWEST, SLOWEST_TURN = 0.05, 0.35
COMMON = {
    "max_vel_x": TOP,
    "max_vel_theta": TOP_TURN,
    "acc_lim_x": ACC,
    "acc_lim_theta": ACC_TURN,
    "xy_goal_tolerance": NEAR,
    "yaw_goal_tolerance": TURNED,
    "latch_xy_goal_tolerance": True,
}
VALUES = {
    TRAJECTORY: {
        **COMMON,
        "min_vel_x": SLOWEST,
        "min_vel_theta": -TOP_TURN,
        "min_in_place_vel_theta": SLOWEST_TURN,
        "holonomic_robot": False,
        "meter_scoring": True,
        "occdist_scale": 0.002,
        "rot_stopped_velocity": 0.05,
        "trans_stopped_velocity": 0.03,
    },
    DWA: {
        **COMMON,
        "max_vel_trans": TOP,
        "min_vel_trans": SLOWEST,
        "max_vel_y": 0.0,
        "min_vel_y": 0.0,
        "min_vel_theta": SLOWEST_TURN,
        "vx_samples": 8,
    },
}


def world(*boxes, padding=0.01):
    """A costmap of 5 x 5 m around the origin, inflated, with boxes (x0, y0, x1, y1) in it."""
    occupied = np.zeros(INFO.shape, np.int8)
    for x0, y0, x1, y1 in boxes:
        a, b = INFO.cell_of(x0, y0), INFO.cell_of(x1, y1)
        occupied[max(a[1], 0) : b[1], max(a[0], 0) : b[0]] = 100
    tree = {
        "plugins": [
            {"name": "static", "type": "costmap_2d::StaticLayer"},
            {"name": "inflation", "type": "costmap_2d::InflationLayer"},
        ],
        "footprint": CORNERS.tolist(),
        "footprint_padding": padding,
        "inflation": {"inflation_radius": 0.6, "cost_scaling_factor": 6.0},
    }
    costmap = LayeredCostmap(read_costmap(tree))
    costmap.static_layers[0].set_map(Grid(INFO, occupied))
    costmap.update(0.0, Pose2D())
    return costmap


@pytest.fixture(params=LOCAL_PLANNERS, ids=short_name)
def make(request):
    def build(costmap=None, **changes):
        tree = {short_name(request.param): {**VALUES[request.param], **changes}}
        costmap = costmap or world()
        return make_local_planner(request.param, tree, costmap, controller_frequency=1.0 / DT)

    build.name = request.param
    return build


def route(*corners, yaw=0.0):
    """A plan through corners, poses 0.05 m apart, that ends with a heading."""
    pieces = []
    for start, end in itertools.pairwise(corners):
        t = np.linspace(0.0, 1.0, max(2, round(math.dist(start, end) / 0.05)))[:, None]
        pieces.append(np.array(start) * (1 - t) + np.array(end) * t)
    return with_headings(np.concatenate(pieces), yaw)


def see(costmap, pose=Pose2D(), velocity=STOP, now=0.0):  # noqa: B008 - a tuple
    grid = costmap.grid
    return LocalView(now=now, pose=pose, velocity=velocity, costmap=Grid(grid.info, grid.cells.copy()))


def moved(pose, twist, dt=DT):
    middle = pose.yaw + twist.wz * dt / 2.0
    c, s = math.cos(middle), math.sin(middle)
    return Pose2D(
        pose.x + (twist.vx * c - twist.vy * s) * dt,
        pose.y + (twist.vx * s + twist.vy * c) * dt,
        wrap_angle(pose.yaw + twist.wz * dt),
    )


def follows(velocity, command, dt=DT):
    """What a base makes of a command: speeds up and slows down within its accelerations."""
    dv, dw = ACC * 1.5 * dt, ACC_TURN * 1.5 * dt
    return Twist2D(
        velocity.vx + min(max(command.vx - velocity.vx, -dv), dv),
        0.0,
        velocity.wz + min(max(command.wz - velocity.wz, -dw), dw),
    )


def touches(costmap, pose, corners=CORNERS):
    """Whether the robot's body, densely filled with points, lies on a lethal cell."""
    x = np.arange(corners[:, 0].min(), corners[:, 0].max() + 1e-9, 0.01)
    y = np.arange(corners[:, 1].min(), corners[:, 1].max() + 1e-9, 0.01)
    body = np.array(np.meshgrid(x, y)).reshape(2, -1)
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    ix = np.floor((pose.x + c * body[0] - s * body[1] - INFO.origin_x) / INFO.resolution).astype(int)
    iy = np.floor((pose.y + s * body[0] + c * body[1] - INFO.origin_y) / INFO.resolution).astype(int)
    return bool((costmap.cells[iy, ix] == 254).any())


class Drive:
    """A closed loop: every pose, command and refusal of a drive to the goal."""

    def __init__(self, planner, costmap, pose=Pose2D(), seconds=40.0):  # noqa: B008 - a tuple
        self.poses, self.commands, self.refusals, self.reached = [pose], [], [], False
        velocity = STOP
        for i in range(round(seconds / DT)):
            view = see(costmap, self.poses[-1], velocity, now=i * DT)
            if planner.is_goal_reached(view):
                self.reached = True
                break
            try:
                command = planner.compute(view)
            except ControlError as err:
                self.refusals.append(str(err))
                command = STOP
            self.commands.append((velocity, command))
            velocity = follows(velocity, command)
            self.poses.append(moved(self.poses[-1], velocity))
            assert not touches(costmap, self.poses[-1]), f"it touches something at {self.poses[-1]}"

    @property
    def end(self):
        return self.poses[-1]

    def off(self, plan):
        """How far it ever was from the plan."""
        path = np.array(self.poses)[:, None, :2]
        return float(np.hypot(*np.moveaxis(path - plan[None, :, :2], -1, 0)).min(axis=1).max())


# ---- following


def test_a_straight_plan(make):
    plan, costmap = route((0, 0), (2, 0)), world()
    planner = make(costmap)
    planner.set_plan(plan)
    drive = Drive(planner, costmap)
    assert drive.reached
    assert drive.refusals == []
    assert math.dist(drive.end[:2], (2, 0)) <= NEAR + 0.01
    assert drive.off(plan) < 0.03
    assert len(drive.commands) * DT < 2.0 / TOP + 5.0
    assert len(planner.visible_plan) >= 2


def test_a_bent_plan(make):
    plan, costmap = route((-1, -1), (1, -1), (1, 1), (-0.5, 1), yaw=2.0), world()
    planner = make(costmap)
    planner.set_plan(plan)
    drive = Drive(planner, costmap, Pose2D(-1, -1, 0))
    assert drive.reached
    assert drive.off(plan) < 0.3


@pytest.mark.parametrize(
    ("goal", "yaw"),
    [((1.0, 0.0), 2.0), ((0.0, 0.8), 0.0), ((-0.7, -0.6), -3.0), ((-1.0, 0.02), 1.5), ((0.12, 0.1), 3.1)],
)
def test_goals_all_around_with_their_heading(make, goal, yaw):
    costmap = world()
    planner = make(costmap)
    planner.set_plan(route((0, 0), goal, yaw=yaw))
    drive = Drive(planner, costmap)
    assert drive.reached
    assert math.dist(drive.end[:2], goal) <= NEAR + 0.02
    assert abs(wrap_angle(drive.end.yaw - yaw)) <= TURNED + 0.01


def test_a_plan_in_another_frame(make):
    costmap = world()
    planner = make(costmap)
    planner.set_plan(route((5, 5), (5, 6.5), yaw=math.pi / 2))
    local_from_plan = Pose2D(-5.0, 5.0, -math.pi / 2)  # (5, 5) there is (0, 0) here, turned clockwise
    start = local_from_plan @ Pose2D(5.0, 5.0, math.pi / 2)
    view = see(costmap, start)
    twist = planner.compute(LocalView(**{**view.__dict__, "local_from_plan": local_from_plan}))
    assert twist.vx > 0.0
    assert abs(twist.wz) < 0.3


def test_the_same_again_is_the_same(make):
    plan, costmap = route((-1, -1), (1, -1), (1, 1)), world((-0.2, -0.6, 0.2, -0.4))
    drives = []
    for _ in range(2):
        planner = make(costmap)
        planner.set_plan(plan)
        drives.append(Drive(planner, costmap, Pose2D(-1, -1, 0), seconds=8.0))
    assert drives[0].commands == drives[1].commands


def test_a_new_plan_to_the_same_goal_changes_nothing(make):
    plan, costmap = route((0, 0), (1.5, 0.3)), world()
    one, two = make(costmap), make(costmap)
    for planner in (one, two):
        planner.set_plan(plan)
    pose, velocity = Pose2D(), STOP
    for _ in range(30):
        two.set_plan(plan)
        view = see(costmap, pose, velocity)
        twist = one.compute(view)
        assert two.compute(view) == twist
        velocity = follows(velocity, twist)
        pose = moved(pose, velocity)


# ---- at the goal


def test_no_velocity_at_the_goal(make):
    planner, costmap = make(), world()
    planner.set_plan(route((0, 0), (0.5, 0), yaw=0.3))
    view = see(costmap, Pose2D(0.5, 0.0, 0.3))
    assert planner.compute(view) == STOP
    assert planner.is_goal_reached(view)
    assert not planner.is_goal_reached(see(costmap, Pose2D(0.5, 0.0, 0.3), Twist2D(0.2)))
    assert not planner.is_goal_reached(see(costmap, Pose2D(0.5, 0.0, 0.6)))


def test_it_stops_before_it_turns(make):
    planner, costmap = make(), world()
    planner.set_plan(route((0, 0), (0.5, 0), yaw=2.0))
    twist = planner.compute(see(costmap, Pose2D(0.5, 0.0, 0.0), Twist2D(0.3, 0.0, 0.0)))
    assert 0.0 <= twist.vx <= 0.3 - ACC * DT + 1e-9
    assert twist.wz == 0.0
    twist = planner.compute(see(costmap, Pose2D(0.5, 0.0, 0.0)))
    assert twist.vx == 0.0
    assert SLOWEST_TURN <= twist.wz <= TOP_TURN


def test_the_latch_keeps_it_turning_where_it_is(make):
    for latch in (True, False):
        planner, costmap = make(latch_xy_goal_tolerance=latch), world()
        planner.set_plan(route((0, 0), (0.5, 0), yaw=2.0))
        planner.compute(see(costmap, Pose2D(0.5, 0.0, 0.0)))
        twist = planner.compute(see(costmap, Pose2D(0.2, 0.0, 0.0)))
        assert (twist.vx == 0.0) is latch


def test_no_room_to_turn_is_said(make):
    costmap = world((-0.5, 0.16, 0.5, 0.3), (-0.5, -0.3, 0.5, -0.16))
    planner = make(costmap)
    planner.set_plan(route((-0.3, 0), (0, 0), yaw=1.5))
    with pytest.raises(ControlError, match="no room to turn"):
        planner.compute(see(costmap))


# ---- limits


def test_velocities_and_accelerations_stay_within_their_limits(make):
    costmap = world((0.6, -0.3, 0.9, 0.1))
    planner = make(costmap)
    planner.set_plan(route((-1, 0), (0.2, 0), (0.5, 0.5), (1.5, 0.5), yaw=-2.0))
    drive = Drive(planner, costmap, Pose2D(-1, 0, 2.0))
    assert drive.reached
    for velocity, command in drive.commands:
        assert -0.1 <= command.vx <= TOP + 1e-9
        assert command.vy == 0.0
        assert abs(command.wz) <= TOP_TURN + 1e-9
        # measured velocities lag: what two cycles give, or the least that moves the base
        assert command.vx <= max(velocity.vx + 2 * ACC * DT, SLOWEST) + 1e-6
        assert abs(command.wz) <= max(abs(velocity.wz) + 2 * ACC_TURN * DT, SLOWEST_TURN) + 1e-6
        if command.vx == 0.0 and command.wz != 0.0 and velocity.vx < SLOWEST:
            assert abs(command.wz) >= min(SLOWEST_TURN, abs(velocity.wz)) - 1e-6


@pytest.mark.parametrize("seed", range(6))
def test_no_velocity_sweeps_over_something(make, seed):
    """Held for two cycles and braked after, by a base that follows at once or slowly: no lethal cell is touched."""
    random = np.random.default_rng(seed)
    driven = 0
    for _ in range(12):
        boxes = [
            (x, y, x + w, y + h)
            for x, y, w, h in random.uniform((-1.2, -1.2, 0.05, 0.05), (1.1, 1.1, 0.5, 0.3), (9, 4))
        ]
        costmap = world(*boxes)
        pose = Pose2D(*random.uniform((-0.4, -0.4, -3.1), (0.4, 0.4, 3.1)).tolist())
        velocity = Twist2D(float(random.uniform(0.0, 0.15)), 0.0, float(random.uniform(-0.5, 0.5)))
        if touches(costmap, pose, CORNERS * 1.12):
            continue
        planner = make(costmap)
        planner.set_plan(route((pose.x, pose.y), tuple(random.uniform(-1.5, 1.5, 2))))
        try:
            command = planner.compute(see(costmap, pose, velocity))
        except ControlError:
            continue
        driven += 1
        for start in (velocity, command):
            now, at = start, pose
            for i in range(160):
                now = follows(now, command if i < 20 else STOP, dt=0.01)
                at = moved(at, now, dt=0.01)
                assert not touches(costmap, at), f"{command} from {pose} with {velocity}"
                if now == STOP:
                    break
    assert driven >= 3


def test_the_last_cell_before_a_wall_is_not_driven_into(make):
    """A fast robot whose braking distance is longer than what it simulates must not come too near."""
    costmap = world((0.6, -2.5, 0.7, 2.5))
    planner = make(costmap, acc_lim_x=0.1, sim_time=0.5)
    planner.set_plan(route((-1, 0), (1.5, 0)))
    free = 0.6 - 0.13 - 0.2  # to a wall that begins there, less the front
    for distance in np.arange(0.05, free, 0.05):
        pose = Pose2D(0.6 - 0.13 - float(distance), 0.0, 0.0)
        try:
            twist = planner.compute(see(costmap, pose, Twist2D(0.2)))
        except ControlError:
            continue
        assert twist.vx**2 / (2 * 0.1) <= distance + 0.05


# ---- narrow places and obstacles


def test_through_a_door(make):
    costmap = world((-0.1, 0.45, 0.05, 2.5), (-0.1, -2.5, 0.05, -0.45))
    planner = make(costmap)
    planner.set_plan(route((-1.2, -0.6), (-0.6, 0), (0.6, 0), (1.2, 0.6)))
    drive = Drive(planner, costmap, Pose2D(-1.2, -0.6, 0.5))
    assert drive.reached


def test_round_something_that_stands_on_the_plan(make):
    costmap = world((-0.2, -0.15, 0.1, 0.2))
    planner = make(costmap)
    planner.set_plan(route((-1.3, 0), (1.3, 0)))
    drive = Drive(planner, costmap, Pose2D(-1.3, 0, 0))
    assert drive.reached


def test_a_wall_across_the_plan_is_said_and_not_touched(make):
    costmap = world((0.3, -2.5, 0.4, 2.5))
    planner = make(costmap)
    planner.set_plan(route((-1, 0), (1.5, 0)))
    drive = Drive(planner, costmap, Pose2D(-1, 0, 0), seconds=15.0)
    assert not drive.reached
    assert "stands on the plan" in drive.refusals[-1]
    assert -0.3 < drive.end.x < 0.17


def test_it_drives_on_when_what_stood_there_has_left(make):
    wall, free = world((0.3, -2.5, 0.4, 2.5)), world()
    planner = make(free)
    planner.set_plan(route((0, 0), (1.5, 0)))
    with pytest.raises(ControlError, match="stands on the plan"):
        planner.compute(see(wall))
    assert planner.compute(see(free)).vx > 0.0


def test_boxed_in_it_moves_nowhere(make):
    costmap = world((-0.5, 0.15, 0.5, 0.5), (-0.5, -0.5, 0.5, -0.15), (0.15, -0.5, 0.5, 0.5), (-0.5, -0.5, -0.15, 0.5))
    planner = make(costmap)
    planner.set_plan(route((0, 0), (1.5, 0)))
    with pytest.raises(ControlError):
        planner.compute(see(costmap))


@pytest.mark.parametrize("gap", [0.2, 0.25])
def test_out_of_the_inflation_of_a_wall(make, gap):
    """It stands along a wall, where there is no room to turn on the spot."""
    costmap = world((-2.5, gap, 2.5, gap + 0.2))
    planner = make(costmap)
    planner.set_plan(route((0, 0), (0.5, -0.3), (1.5, -0.8)))
    drive = Drive(planner, costmap)
    assert drive.reached


def test_away_from_what_it_touches(make):
    """The padded outline lies on a wall ahead: it backs out, or turns round on the spot."""
    costmap = world((0.16, -0.6, 0.4, 0.6), padding=0.04)
    planner = make(costmap)
    planner.set_plan(route((0, 0), (-1.5, 0)))
    pose, least = Pose2D(0.0, 0.0, 0.0), 0.0
    for _ in range(60):
        try:
            twist = planner.compute(see(costmap, pose))
        except ControlError:
            break
        assert twist.vx * math.cos(pose.yaw) <= 0.02
        pose = moved(pose, twist)
        assert not touches(costmap, pose)
        least = min(least, pose.x)
    assert least < -0.03


def test_unknown_space_is_not_driven_into(make):
    costmap = world()
    costmap.cells[:, INFO.cell_of(0.3, 0.0)[0] :] = 255
    planner = make(costmap)
    planner.set_plan(route((-0.5, 0), (0.2, 0)))
    pose = Pose2D(-0.5, 0.0, 0.0)
    for _ in range(40):
        try:
            pose = moved(pose, planner.compute(see(costmap, pose)))
        except ControlError:
            break
    assert pose.x + 0.13 < 0.3 + 1e-6


def test_it_does_not_waver(make):
    """A plan straight behind, and a heading that is measured with noise: the side is chosen, and kept."""
    costmap, random = world(), np.random.default_rng(2)
    planner = make(costmap)
    planner.set_plan(route((0, 0), (-1.5, 0)))
    pose, velocity, signs = Pose2D(), STOP, []
    for _ in range(60):
        seen = Pose2D(pose.x, pose.y, wrap_angle(pose.yaw + float(random.uniform(-0.1, 0.1))))
        twist = planner.compute(see(costmap, seen, velocity))
        if abs(twist.vx) < SLOWEST:
            signs.append(math.copysign(1.0, twist.wz))
        velocity = follows(velocity, twist)
        pose = moved(pose, velocity)
        if abs(wrap_angle(pose.yaw - math.pi)) < 0.5:
            break
    assert np.count_nonzero(np.diff(signs)) <= 1
    assert abs(wrap_angle(pose.yaw - math.pi)) < 0.5


# ---- what is refused


def test_no_plan(make):
    with pytest.raises(ControlError, match="no plan"):
        make().compute(see(world()))
    with pytest.raises(ControlError, match="without poses"):
        make().set_plan(np.empty((0, 3)))
    assert not make().is_goal_reached(see(world()))


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_a_plan_that_is_no_number(make, wrong):
    plan = route((0, 0), (1, 0))
    plan[3, 1] = wrong
    planner = make()
    with pytest.raises(ControlError, match="no numbers"):
        planner.set_plan(plan)


def test_a_pose_that_is_no_number(make):
    planner = make()
    planner.set_plan(route((0, 0), (1, 0)))
    for view in (see(world(), Pose2D(math.nan, 0, 0)), see(world(), Pose2D(), Twist2D(math.nan))):
        with pytest.raises(ControlError, match="not a number"):
            planner.compute(view)


def test_a_plan_off_the_costmap(make):
    planner = make()
    planner.set_plan(route((10, 10), (12, 10)))
    with pytest.raises(ControlError, match="local costmap"):
        planner.compute(see(world()))


def test_a_robot_off_the_costmap(make):
    planner = make()
    planner.set_plan(route((2, 0), (3.5, 0)))
    with pytest.raises(ControlError):
        planner.compute(see(world(), Pose2D(3.0, 0.0, 0.0)))


# ---- parameters while driving


def test_parameters_change_between_cycles_and_plan_and_goal_stay(make):
    planner, costmap = make(), world()
    planner.set_plan(route((0, 0), (2, 0)))
    assert planner.compute(see(costmap, velocity=Twist2D(TOP))).vx == pytest.approx(TOP)
    speeds = {"max_vel_x": 0.2} if make.name == TRAJECTORY else {"max_vel_x": 0.2, "max_vel_trans": 0.2}
    assert planner.reconfigure(speeds).max_vel_x == 0.2
    assert planner.compute(see(costmap, velocity=Twist2D(0.2))).vx == pytest.approx(0.2)
    assert planner.reconfigure({"sim_time": -1.0}).sim_time == 0.1  # clamped, as upstream does
    with pytest.raises(ParamError, match="sim_time"):
        planner.reconfigure({"sim_time": "long"})
    with pytest.raises(ParamError, match="max_vel_z"):
        planner.reconfigure({"max_vel_z": 1.0})
    with pytest.raises(TypeError):
        planner.set_params(object())
    assert planner.params.max_vel_x == 0.2


def test_the_latch_outlives_a_change(make):
    planner, costmap = make(), world()
    planner.set_plan(route((0, 0), (0.5, 0), yaw=2.0))
    planner.compute(see(costmap, Pose2D(0.5, 0.0, 0.0)))
    planner.reconfigure({"occdist_scale": 0.02})
    assert planner.compute(see(costmap, Pose2D(0.2, 0.0, 0.0))).vx == 0.0


def test_a_limit_of_speed_holds_for_its_distance(make):
    planner, costmap = make(), world()
    planner.set_plan(route((-2, 0), (2, 0)))
    planner.limit_speed(0.1, 0.45, distance=0.3)
    pose, velocity = Pose2D(-2.0, 0.0, 0.4), STOP
    while pose.x < 0.0:
        twist = planner.compute(see(costmap, pose, velocity))
        if math.dist(pose[:2], (-2, 0)) < 0.3:
            assert twist.vx <= 0.1 + 1e-9
            assert abs(twist.wz) <= 0.45 + 1e-9
        velocity = follows(velocity, twist)
        pose = moved(pose, velocity)
    assert velocity.vx > 0.3


def test_what_can_be_tuned_is_declared(make):
    rows = {row.name: row for row in TUNABLE[make.name]}
    assert {"max_vel_x", "sim_time", "path_distance_bias", "xy_goal_tolerance"} <= set(rows)
    assert rows["sim_time"].type == "float"
    assert rows["sim_time"].lo == 0.1
    assert rows["vx_samples"].type == "int"
    assert rows["latch_xy_goal_tolerance"].type == "bool"
    assert all(row.doc for row in rows.values())
    planner = make()
    values = {name: getattr(planner.params, name) for name in rows if name != "restore_defaults"}
    assert planner.reconfigure(values) == planner.params


def test_old_names_are_taken_and_told(make, caplog):
    new = "path_distance_bias"
    planner = make(pdist_scale=0.37, goal_distance_bias=0.9, gdist_scale=0.1)
    assert getattr(planner.params, new) == 0.37
    assert planner.params.goal_distance_bias == 0.9
    assert "pdist_scale is now called path_distance_bias" in caplog.text
