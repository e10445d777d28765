"""Recovery behaviours and the registry of plug-in names."""

from __future__ import annotations

import math

import pytest

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import ParamError
from rosbot_patrol.geometry import Pose2D, wrap_angle
from rosbot_patrol.planning.interfaces import RecoveryView
from rosbot_patrol.planning.recoveries import ClearCostmap, ClearCostmapParams, Rotate, RotateParams
from rosbot_patrol.planning.registry import make_global_planner, make_local_planner, make_recoveries


def costmap():
    tree = {"rolling_window": True, "width": 4.0, "height": 4.0, "resolution": 0.05, "robot_radius": 0.2}
    made = LayeredCostmap(read_costmap(tree))
    made.update(0.0, Pose2D())
    return made


def view(pose, now, local):
    return RecoveryView(now=now, pose_global=pose, pose_local=pose, global_costmap=local, local_costmap=local)


def turn(rotate, local, seconds=60.0):
    pose, now, total = Pose2D(), 0.0, 0.0
    rotate.start(view(pose, now, local))
    while now < seconds:
        twist = rotate.step(view(pose, now, local))
        if twist is None:
            return total, now
        assert twist.vx == 0.0
        total += twist.wz * 0.1
        pose, now = Pose2D(0.0, 0.0, wrap_angle(pose.yaw + twist.wz * 0.1)), now + 0.1
    raise AssertionError("it never ended")


def test_a_rotation_turns_once():
    total, _ = turn(Rotate(RotateParams(), name="r"), costmap())
    assert total == pytest.approx(math.tau, abs=0.2)


def test_a_rotation_ends_where_something_is_in_the_way():
    local = costmap()
    local.cells[local.info.cell_of(0.0, 0.2)[1], local.info.cell_of(0.0, 0.2)[0]] = 254
    rotate = Rotate(RotateParams(), name="r")
    rotate.start(view(Pose2D(), 0.0, local))
    assert rotate.step(view(Pose2D(), 0.0, local)) is None
    assert "in the way" in rotate.last_words


def test_a_rotation_of_a_base_that_does_not_move_ends():
    rotate, local = Rotate(RotateParams(), name="r"), costmap()
    rotate.start(view(Pose2D(), 0.0, local))
    assert rotate.step(view(Pose2D(), 10.0, local)) is not None
    assert rotate.step(view(Pose2D(), 100.0, local)) is None
    assert "does not follow" in rotate.last_words


def test_clearing_is_done_at_once():
    clear, local = ClearCostmap(ClearCostmapParams(), name="c"), costmap()
    clear.start(view(Pose2D(), 0.0, local))
    assert clear.step(view(Pose2D(), 0.0, local)) is None


def recoveries(tree):
    return make_recoveries(tree, conservative=3.0, clearing_radius=0.46, clearing_rotation=True)


def test_upstreams_four_behaviours():
    made = recoveries({})
    assert [r.name for r in made] == ["conservative_reset", "rotate_recovery", "aggressive_reset", "rotate_recovery"]
    assert made[0].params.reset_distance == 3.0
    assert made[2].params.reset_distance == pytest.approx(1.84)


def test_listed_behaviours_with_their_parameters():
    made = recoveries(
        {
            "recovery_behaviors": [{"name": "clear", "type": "clear_costmap_recovery/ClearCostmapRecovery"}],
            "clear": {"reset_distance": 1.5},
        }
    )
    assert [(r.name, r.params.reset_distance) for r in made] == [("clear", 1.5)]


@pytest.mark.parametrize("listed", [3, [3], [{"name": "a"}], [{"name": "a", "type": "x/Jump"}]])
def test_a_wrong_list_is_named(listed):
    with pytest.raises(ParamError, match="recovery_behaviors"):
        recoveries({"recovery_behaviors": listed})


def test_unknown_plugins_are_named():
    with pytest.raises(ParamError, match="carrot"):
        make_global_planner("carrot_planner/CarrotPlanner", {})
    with pytest.raises(ParamError, match="teb"):
        make_local_planner("teb_local_planner/TebLocalPlannerROS", {}, costmap(), controller_frequency=10.0)
    with pytest.raises(ParamError, match="NavfnROS"):
        make_global_planner("navfn/NavfnROS", {"NavfnROS": 3})
