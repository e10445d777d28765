"""What each kind of input does to the state: the cases of upstream's test_ekf_localization_node_interfaces."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rosbot_patrol.ekf.core import FilterCore
from rosbot_patrol.ekf.filter import Ekf
from rosbot_patrol.ekf.readings import AccelerationReading, Frame, PoseReading, TwistReading
from rosbot_patrol.ekf.sensor import SensorConfig, Surroundings
from rosbot_patrol.ekf.state import SIZE, Array, rotation
from rosbot_patrol.errors import TransformError

RATE = 20.0  # readings a second
SURE = np.eye(6) * 1e-6
GRAVITY = 9.80665
Reading = PoseReading | TwistReading | AccelerationReading


def core_of(mask: str, *, is_planar: bool = False, mounting: Frame | None = None, **options: object) -> FilterCore:
    def lookup(target: str, source: str, stamp: float) -> Frame:
        if source == "nowhere":
            raise TransformError(target, source, "it is not known")
        return mounting or Frame()

    around = Surroundings(world="odom", base="base_link", lookup=lookup, is_planar=is_planar, gravity=GRAVITY)
    chosen = np.array([each == "1" for each in mask.replace(" ", "")])
    config = SensorConfig(topic="in0", mask=chosen, **options)  # type: ignore[arg-type]
    return FilterCore(Ekf(np.eye(SIZE) * 0.05, np.eye(SIZE) * 1e-9), {"in0": config}, around, 0.1)


def drive(core: FilterCore, seconds: float, *makers: Callable[[float], Reading]) -> Array:
    """Send readings for a time; returns the state."""
    for number in range(round(seconds * RATE) + 1):
        stamp = 1.0 + number / RATE
        for make in makers:
            core.hear("in0", make(stamp))
        core.update(stamp)
    return core.state


def pose(
    x: float = 0.0, y: float = 0.0, z: float = 0.0, rpy: tuple[float, float, float] = (0.0, 0.0, 0.0), frame: str = ""
) -> Callable[[float], Reading]:
    return lambda stamp: PoseReading(stamp, frame, Frame(rotation(*rpy), np.array([x, y, z])), SURE)


def twist(
    linear: tuple[float, float, float] = (0.0, 0.0, 0.0), angular: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Callable[[float], Reading]:
    return lambda stamp: TwistReading(stamp, "", np.array(linear), np.array(angular), SURE)


def imu(*rpy: float) -> Callable[[float], Reading]:
    return lambda stamp: PoseReading(stamp, "imu", Frame(rotation(*rpy)), SURE, is_orientation=True)


def test_poses_are_taken_as_they_are() -> None:
    state = drive(core_of("111 111 000 000 000"), 5.0, pose(20.0, 10.0, -40.0, (0.3, -0.2, 1.5)))
    assert state[:6] == pytest.approx([20.0, 10.0, -40.0, 0.3, -0.2, 1.5], abs=1e-3)


def test_what_is_not_configured_does_not_count() -> None:
    state = drive(core_of("100 000 000 000 000"), 5.0, pose(20.0, 10.0, -40.0, (0.3, -0.2, 1.5)))
    assert state[:6] == pytest.approx([20.0, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_speed_of_five_for_twenty_seconds_is_a_hundred_metres(axis: int) -> None:
    linear = tuple(5.0 if each == axis else 0.0 for each in range(3))
    state = drive(core_of("000 000 111 111 000"), 20.0, twist(linear))  # type: ignore[arg-type]
    assert state[axis] == pytest.approx(100.0, abs=2.0)
    assert np.abs(np.delete(state[:3], axis)).max() < 1.0


@pytest.mark.parametrize("axis", [0, 2])
def test_turning_speeds_add_up(axis: int) -> None:
    angular = tuple(math.pi / 2.0 / 10.0 if each == axis else 0.0 for each in range(3))
    state = drive(core_of("000 000 111 111 000"), 10.0, twist(angular=angular))  # type: ignore[arg-type]
    assert state[3 + axis] == pytest.approx(math.pi / 2.0, abs=0.05)


def test_driving_while_turning_by_a_quarter_goes_round_a_corner() -> None:
    rate = math.pi / 2.0 / 10.0
    state = drive(core_of("000 000 111 111 000"), 10.0, twist((1.0, 0.0, 0.0), (0.0, 0.0, rate)))
    radius = 1.0 / rate
    assert state[:2] == pytest.approx([radius, radius], abs=0.3)


def test_the_orientation_of_an_imu_counts_without_its_mounting() -> None:
    mounting = Frame(rotation(0.0, 0.0, 0.5), np.array([0.2, 0.0, 0.1]))
    state = drive(core_of("000 111 000 000 000", mounting=mounting), 5.0, imu(0.0, 0.0, 1.3))
    assert state[5] == pytest.approx(0.8, abs=1e-3)
    assert state[:3] == pytest.approx([0.0, 0.0, 0.0], abs=1e-3)


def test_accelerations_add_up_and_gravity_is_taken_off() -> None:
    core = core_of("000 000 000 000 111", removes_gravity=True)

    def felt(stamp: float) -> Reading:
        return AccelerationReading(stamp, "", np.array([0.4, 0.0, GRAVITY]), np.eye(3) * 1e-6, np.eye(3))

    state = drive(core, 10.0, felt)
    assert state[6] == pytest.approx(4.0, abs=0.2)
    assert state[0] == pytest.approx(20.0, abs=1.5)
    assert abs(state[2]) < 0.1


def test_differential_poses_count_by_their_change() -> None:
    core = core_of("111 111 000 000 000", is_differential=True)
    state = drive(core, 0.0, pose(500.0, 500.0))
    assert state[:2] == pytest.approx([0.0, 0.0], abs=0.01)
    state = drive(core, 10.0, lambda stamp: pose(500.0 + stamp)(stamp))
    assert state[0] == pytest.approx(10.0, abs=0.5)
    assert state[6] == pytest.approx(1.0, abs=0.05)


def test_relative_poses_count_from_the_first() -> None:
    core = core_of("111 111 000 000 000", is_relative=True)
    state = drive(core, 5.0, lambda stamp: pose(500.0, 100.0 + stamp, rpy=(0.0, 0.0, math.pi / 2.0))(stamp))
    assert state[0] == pytest.approx(5.0, abs=0.1)  # ahead, by the first heading
    assert state[1] == pytest.approx(0.0, abs=0.05)
    assert state[5] == pytest.approx(0.0, abs=1e-3)


def test_a_differential_imu_turns_by_its_change() -> None:
    core = core_of("000 001 000 000 000", is_differential=True)
    state = drive(core, 10.0, lambda stamp: imu(0.0, 0.0, 2.0 + 0.1 * stamp)(stamp))
    assert state[5] == pytest.approx(1.0, abs=0.05)
    assert state[11] == pytest.approx(0.1, abs=0.01)


def test_a_yaw_that_passes_half_a_turn_does_not_jump() -> None:
    core = core_of("000 001 000 000 000")
    seen = [drive(core, 0.0, imu(0.0, 0.0, yaw))[5] for yaw in (3.0,)]
    for number in range(1, 60):
        stamp = 1.0 + number / RATE
        core.hear("in0", imu(0.0, 0.0, 3.0 + 0.01 * number)(stamp))
        core.update(stamp)
        seen.append(core.state[5])
    steps = np.angle(np.exp(1j * np.diff(seen)))
    assert np.abs(steps).max() < 0.05


def test_on_a_plane_height_and_tilt_stay_zero() -> None:
    state = drive(core_of("111 111 000 000 000", is_planar=True), 5.0, pose(1.0, 2.0, 3.0, (0.3, 0.2, 0.1)))
    assert state[:6] == pytest.approx([1.0, 2.0, 0.0, 0.0, 0.0, 0.1], abs=0.01)


def test_a_pose_that_is_too_far_off_is_rejected_and_counted() -> None:
    core = core_of("111 111 000 000 000", pose_threshold=3.0)
    drive(core, 2.0, pose(1.0))
    core.hear("in0", pose(90.0)(4.0))
    core.update(4.0)
    assert core.state[0] == pytest.approx(1.0, abs=0.05)
    assert core.counts["in0"].rejected == 1


def test_a_turning_speed_of_an_imu_that_is_too_far_off_is_rejected() -> None:
    core = core_of("000 001 000 001 000", twist_threshold=0.8)
    drive(core, 2.0, imu(0.0, 0.0, 0.0), twist())
    core.hear("in0", twist(angular=(0.0, 0.0, 40.0))(4.0))
    core.update(4.0)
    assert abs(core.state[11]) < 0.05
    assert core.counts["in0"].rejected >= 1


def test_a_frame_that_is_not_known_loses_the_reading_and_says_which() -> None:
    core = core_of("111 111 000 000 000")
    core.hear("in0", pose(1.0, frame="nowhere")(1.0))
    core.update(1.0)
    assert core.counts["in0"].lost == 1
    assert "nowhere" in core.counts["in0"].problem
    assert not core.ekf.is_begun


def test_an_older_reading_is_late_and_an_equal_one_is_taken() -> None:
    core = core_of("111 111 000 000 000")
    drive(core, 1.0, pose(1.0))
    core.hear("in0", pose(5.0)(1.5))
    assert core.counts["in0"].late == 1
    core.hear("in0", pose(1.0)(2.0))
    assert core.counts["in0"].late == 1


def test_a_set_pose_holds_and_what_was_before_is_late() -> None:
    core = core_of("000 000 111 111 000")
    drive(core, 5.0, twist((1.0, 0.0, 0.0)))
    core.set_pose(10.0, np.array([1.0, 2.0, 0.0, 0.0, 0.0, 0.7]), np.eye(6) * 1e-6)
    assert core.state[:6] == pytest.approx([1.0, 2.0, 0.0, 0.0, 0.0, 0.7], abs=1e-3)
    core.hear("in0", twist((1.0, 0.0, 0.0))(9.0))
    assert core.counts["in0"].late == 1


def test_silence_is_predicted_with_the_last_speed() -> None:
    core = core_of("000 000 111 111 000")
    drive(core, 5.0, twist((1.0, 0.0, 0.0)))
    before = float(core.state[0])
    for number in range(1, 21):
        core.update(6.0 + number / RATE)
    assert core.state[0] - before == pytest.approx(1.0, abs=0.1)


def test_a_clock_that_went_back_begins_anew() -> None:
    core = core_of("111 111 000 000 000")
    drive(core, 5.0, pose(7.0))
    core.forget()
    core.hear("in0", pose(2.0)(0.5))
    core.update(0.5)
    assert core.state[0] == pytest.approx(2.0, abs=0.01)


def test_numbers_that_are_not_finite_and_variances_of_zero_are_counted() -> None:
    core = core_of("000 000 111 111 000")
    drive(core, 1.0, twist((1.0, 0.0, 0.0)))
    core.hear("in0", twist((math.nan, 0.0, 0.0))(3.0))
    core.hear("in0", TwistReading(3.1, "", np.array([1.0, 0.0, 0.0]), np.zeros(3), np.zeros((6, 6))))
    core.update(4.0)
    assert (core.counts["in0"].spoilt, core.counts["in0"].unspread) == (1, 1)
    assert np.isfinite(core.state).all()
