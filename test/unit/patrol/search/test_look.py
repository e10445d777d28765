import math

import pytest

from rosbot_patrol.geometry import Pose2D, wrap_angle
from rosbot_patrol.patrol.records.inputs import Inputs
from rosbot_patrol.patrol.search.look import Look, LookParams
from rosbot_patrol.patrol.search.turn import SpinParams


def turn(odom_gain=1.0, map_offset=lambda truth: 0.0, has_pose=True, stuck_after=None):
    """A base whose odometry reads `odom_gain` times the truth; gives the last step, the look, the truth [deg]."""
    look = Look(LookParams(), SpinParams())
    truth = now = 0.0
    while now < 120.0:
        pose = Pose2D(0.0, 0.0, wrap_angle(truth + map_offset(truth))) if has_pose else None
        inputs = Inputs(yaw=wrap_angle(truth * odom_gain), pose=pose, detector_at=now, camera_at=now)
        step = look.step(now, inputs, candidate=False)
        if step.done:
            return step, look, math.degrees(truth)
        if stuck_after is None or truth < stuck_after:
            truth += step.speed * 0.04
        now += 0.04
    raise AssertionError("the look never ended")


@pytest.mark.parametrize("gain", [0.97, 0.985, 1.0, 1.02, 1.05])
def test_wheels_that_slip_are_corrected_by_the_map(gain):
    step, look, truth = turn(odom_gain=gain)
    assert step.problem == ""
    assert abs(truth - 360) < 3
    assert abs(look.turned_deg - 360) < 3


def test_without_a_pose_in_the_map_odom_has_to_do():
    step, look, truth = turn(odom_gain=1.02, has_pose=False)
    assert step.problem == ""
    assert truth == pytest.approx(360 / 1.02, abs=2)
    assert look.turned_deg == pytest.approx(360, abs=2)


def test_a_lost_localisation_is_not_believed():
    step, look, truth = turn(map_offset=lambda truth: -1.0 if truth > 3.0 else 0.0)
    assert step.problem == ""
    assert abs(truth - 360) < 3
    assert look.turned_deg == pytest.approx(360, abs=3)


def test_a_correction_that_fails_takes_nothing_from_the_turn():
    step, _, truth = turn(odom_gain=1.05, stuck_after=(math.tau - 0.015) / 1.05)
    assert step.problem == ""
    assert truth < 345


def test_the_wait_for_the_eyes_is_bounded():
    look = Look(LookParams(detector_wait=5.0), SpinParams())
    assert look.step(0.0, Inputs(yaw=0.0), candidate=False).speed == 0.0
    assert "before the turn: the camera has not" in look.step(2.0, Inputs(yaw=0.0), candidate=False).why
    seeing = Inputs(yaw=0.0, camera_at=4.9)
    assert "before the turn: the detector has not been heard" in look.step(4.9, seeing, candidate=False).why
    assert look.step(5.1, Inputs(yaw=0.0), candidate=False).speed > 0.0


def test_a_hold_ends_by_itself():
    look = Look(LookParams(hold=2.0), SpinParams())
    speeds = []
    for i in range(200):
        now = i * 0.04
        inputs = Inputs(yaw=0.001 * i, detector_at=now, camera_at=now)
        speeds.append(look.step(now, inputs, candidate=True).speed)
    still = speeds.count(0.0) * 0.04
    assert 3.0 < still < 6.0


@pytest.mark.parametrize("silent", ["camera_at", "detector_at"])
@pytest.mark.parametrize(("pause", "counts"), [(0.9, True), (6.0, True), (14.0, False)])
def test_the_turn_waits_for_a_camera_or_detector_that_comes_back(silent, pause, counts):
    look = Look(LookParams(), SpinParams())
    yaw = now = turned_unseen = 0.0
    step = None
    while step is None or not step.done:
        last = 4.0 if 4.0 < now < 4.0 + pause else now
        inputs = Inputs(yaw=wrap_angle(yaw), **{"detector_at": now, "camera_at": now, silent: last})
        step = look.step(now, inputs, candidate=False)
        yaw += step.speed * 0.04
        turned_unseen += step.speed * 0.04 * (last < now)
        now += 0.04
    assert (step.problem == "") is counts
    assert yaw == pytest.approx(math.tau, abs=0.1)
    if counts:
        assert turned_unseen < 0.9  # of a camera that sees one radian


@pytest.mark.parametrize(
    ("seen_until", "changed_until", "problem"),
    [
        (math.inf, math.inf, ""),
        (4.0, math.inf, "the camera has shown nothing for more than 3 s"),
        (math.inf, 4.0, "the camera showed the same picture for more than 3 s of turning"),
        (math.inf, -math.inf, "the camera showed the same picture for more than 3 s of turning"),
    ],
)
def test_a_camera_that_goes_black_or_freezes_has_not_looked(seen_until, changed_until, problem):
    look = Look(LookParams(), SpinParams())
    yaw = now = 0.0
    step = look.step(now, Inputs(yaw=yaw, detector_at=now, camera_at=now), candidate=False)
    while not step.done:
        now += 0.04
        yaw += step.speed * 0.04
        inputs = Inputs(
            yaw=wrap_angle(yaw),
            detector_at=now,
            camera_at=min(now, seen_until),
            camera_changed_at=min(now, changed_until),
        )
        step = look.step(now, inputs, candidate=False)
    assert step.problem == problem
