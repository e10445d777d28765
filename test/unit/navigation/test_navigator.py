"""The state machine of move_base, step by step."""

from __future__ import annotations

import numpy as np
import pytest

from rosbot_patrol.costmap.layered import LayeredCostmap
from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import ControlError, NoPath, OutOfBounds
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D
from rosbot_patrol.navigation.interfaces import NavigatorView, PlanResult, Reason, State
from rosbot_patrol.navigation.navigator import Navigator
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.planning.interfaces import LocalPlanner, LocalView, Recovery, RecoveryView

GOAL = Pose2D(5.0, 0.0)
PLAN = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
FORWARD = Twist2D(0.3)
TURN = Twist2D(0.0, 0.0, 1.0)


class Plans:
    def __init__(self):
        self.answer = PlanResult(poses=PLAN)
        self.requests, self.dropped, self._ready, self.slow = 0, 0, None, False

    def request(self, goal):
        self.requests += 1
        self._ready = None if self.slow else self.answer

    def poll(self):
        ready, self._ready = self._ready, None
        return ready

    @property
    def is_busy(self):
        return self.slow

    def drop(self):
        self.dropped += 1
        self._ready = None


class Controller(LocalPlanner):
    def __init__(self):
        self.fails, self.arrived, self.refuses, self.plans = False, False, False, 0

    def set_plan(self, poses):
        if self.refuses:
            raise ControlError("no")
        self.plans += 1

    def compute(self, view):
        if self.fails:
            raise ControlError("blocked")
        return FORWARD

    def is_goal_reached(self, view):
        return self.arrived


class Spin(Recovery):
    def __init__(self, name, steps=2):
        self.name, self.steps, self.left, self.started = name, steps, 0, 0

    def start(self, view):
        self.left, self.started = self.steps, self.started + 1

    def step(self, view):
        self.left -= 1
        return TURN if self.left >= 0 else None


COSTMAP = LayeredCostmap(read_costmap({"rolling_window": True, "width": 1.0, "height": 1.0}))


class Bench:
    """A navigator with its surroundings, and a clock."""

    def __init__(self, **params):
        self.plans, self.controller = Plans(), Controller()
        self.recoveries = [Spin("first"), Spin("second")]
        self.pose, self.current, self.now = Pose2D(), True, 0.0
        self.someone = ""
        self.commands = []
        self.navigator = Navigator(
            MoveBaseParams(**{"planner_patience": 2.0, "controller_patience": 3.0, **params}),
            plans=self.plans,
            controller=self.controller,
            recoveries=self.recoveries,
        )

    def view(self):
        return NavigatorView(
            local=LocalView(now=self.now, pose=self.pose, velocity=STOP, costmap=COSTMAP.grid),
            recovery=RecoveryView(
                now=self.now,
                pose_global=self.pose,
                pose_local=self.pose,
                global_costmap=COSTMAP,
                local_costmap=COSTMAP,
            ),
            is_current=self.current,
            must_wait=lambda wish: self.someone if wish != STOP else "",
        )

    def step(self, *, blind=False):
        command = self.navigator.step(self.now, None if blind else self.view())
        self.commands.append(command)
        self.now += 0.1
        return command

    def go(self):
        self.navigator.set_goal(GOAL, self.now)
        return self.step()

    def until_outcome(self, limit=1000):
        for _ in range(limit):
            outcome = self.step().outcome
            if outcome:
                return outcome
        raise AssertionError("no outcome")


def test_without_a_goal_nothing_is_sent():
    assert Bench().step().twist is None


def test_a_goal_is_planned_driven_and_reached():
    bench = Bench()
    assert bench.go().plan is PLAN
    assert bench.step().twist == FORWARD
    bench.controller.arrived = True
    command = bench.step()
    assert (command.twist, command.outcome.succeeded, command.outcome.text) == (STOP, True, "Goal reached.")
    assert bench.navigator.state is State.IDLE
    assert bench.step().twist is None


def test_while_planning_it_stands():
    bench = Bench()
    bench.plans.slow = True
    assert bench.go().twist == STOP
    assert bench.step().twist == STOP


def test_no_plan_ends_after_all_recoveries_with_upstreams_text():
    bench = Bench()
    bench.plans.answer = PlanResult(error=NoPath((0, 0), (5, 0)))
    bench.go()
    outcome = bench.until_outcome()
    assert outcome.text == "Failed to find a valid plan. Even after executing recovery behaviors."
    assert [r.started for r in bench.recoveries] == [1, 1]
    begun = [c.recovery for c in bench.commands if c.recovery]
    assert begun == [(0, 2, "first"), (1, 2, "second")]
    assert bench.now > 3 * 2.0


def test_planning_retries_are_limited():
    bench = Bench(max_planning_retries=1, recovery_behavior_enabled=False)
    bench.plans.answer = PlanResult(error=OutOfBounds("goal", 9, 9))
    bench.go()
    bench.until_outcome()
    assert bench.now < 1.0


def test_no_velocity_plans_again_then_recovers_then_aborts():
    bench = Bench()
    bench.controller.fails = True
    bench.go()
    outcome = bench.until_outcome()
    assert outcome.text == "Failed to find a valid control. Even after executing recovery behaviors."
    assert bench.plans.requests > 5
    assert 3 * 3.0 < bench.now < 15.0


def test_control_that_comes_back_starts_recovery_anew():
    bench = Bench()
    bench.controller.fails = True
    bench.go()
    while bench.recoveries[0].started == 0:
        bench.step()
    bench.controller.fails = False
    for _ in range(30):
        bench.step()
    bench.controller.fails = True
    while bench.recoveries[0].started == 1:
        bench.step()
    assert bench.recoveries[1].started == 0


def test_standing_still_too_long_is_oscillation():
    bench = Bench(oscillation_timeout=5.0, oscillation_distance=0.5)
    bench.go()
    outcome = bench.until_outcome()
    assert outcome.text == "Robot is oscillating. Even after executing recovery behaviors."


def test_moving_on_is_no_oscillation():
    bench = Bench(oscillation_timeout=5.0, oscillation_distance=0.5)
    bench.go()
    for i in range(300):
        bench.pose = Pose2D(0.03 * i, 0.0)
        assert bench.step().outcome is None
    assert [r.started for r in bench.recoveries] == [0, 0]


@pytest.mark.parametrize("state", [State.PLANNING, State.CONTROLLING, State.CLEARING])
def test_cancel_stops_in_every_state(state):
    bench = Bench()
    bench.plans.slow = state is State.PLANNING
    bench.controller.fails = state is State.CLEARING
    bench.go()
    while bench.navigator.state is not state or (state is State.CLEARING and bench.commands[-1].twist != TURN):
        bench.step()
    assert bench.navigator.cancel().twist == STOP
    assert bench.navigator.state is State.IDLE
    assert bench.step().twist is None


def test_a_new_goal_replaces_the_old_without_stopping():
    bench = Bench()
    bench.go()
    assert bench.step().twist == FORWARD
    bench.navigator.set_goal(Pose2D(1.0, 1.0), bench.now)
    assert bench.navigator.goal == Pose2D(1.0, 1.0)
    assert bench.step().twist == FORWARD


def test_a_new_goal_while_driving_holds_the_velocity_for_a_short_time_only():
    bench = Bench()
    bench.go()
    bench.plans.slow = True
    bench.navigator.set_goal(Pose2D(1.0, 1.0), bench.now)
    assert [bench.step().twist for _ in range(5)] == [None, None, None, None, STOP]
    bench.navigator.set_goal(Pose2D(2.0, 1.0), bench.now)  # it stands by now
    assert bench.step().twist == STOP


@pytest.mark.parametrize("blind", [False, True])
@pytest.mark.parametrize("state", [State.PLANNING, State.CONTROLLING])
def test_waiting_for_sensors_or_the_pose_is_no_failure(state, blind):
    bench = Bench(oscillation_timeout=5.0)
    bench.go()
    bench.controller.fails = state is State.PLANNING
    bench.step()
    bench.current = blind
    assert {bench.step(blind=blind).twist for _ in range(200)} == {STOP}
    bench.current, bench.controller.fails = True, False
    bench.step()
    assert bench.step().twist == FORWARD
    assert [r.started for r in bench.recoveries] == [0, 0]


def test_stale_sensors_stop_the_robot():
    bench = Bench()
    bench.go()
    bench.current = False
    assert bench.step().twist == STOP
    bench.current = True
    assert bench.step().twist == FORWARD


def test_stale_sensors_stop_a_recovery():
    bench = Bench()
    bench.recoveries[0].steps = 20
    bench.controller.fails = True
    bench.go()
    while bench.commands[-1].twist != TURN:
        bench.step()
    bench.current = False
    assert bench.step().twist == STOP
    bench.current = True
    assert bench.step().twist == TURN


def test_an_unknown_pose_stops_the_robot():
    bench = Bench()
    bench.go()
    assert bench.step(blind=True).twist == STOP
    assert bench.step().twist == FORWARD


def test_planning_goes_on_at_its_frequency():
    bench = Bench(planner_frequency=2.0)
    bench.go()
    before = bench.plans.requests
    for _ in range(50):
        bench.step()
    assert 8 <= bench.plans.requests - before <= 11


def test_a_failed_plan_on_the_way_keeps_the_old_one():
    bench = Bench(planner_frequency=2.0)
    bench.go()
    bench.plans.answer = PlanResult(error=NoPath((0, 0), (5, 0)))
    for _ in range(100):
        assert bench.step().twist == FORWARD


def test_a_plan_that_the_controller_refuses_aborts():
    bench = Bench()
    bench.controller.refuses = True
    assert bench.go().outcome.text == "Failed to pass global plan to the controller."


def test_it_waits_for_somebody_without_counting_that_as_being_stuck():
    bench = Bench(oscillation_timeout=2.0)
    bench.navigator.set_goal(GOAL, 0.0)
    bench.step()
    assert bench.step().twist == FORWARD
    bench.someone = "someone comes this way"
    for _ in range(100):
        command = bench.step()
        assert command.twist == STOP
        assert (command.reason, command.text) == (Reason.WAITING, "waiting: someone comes this way")
    assert bench.navigator.state is State.CONTROLLING
    bench.someone = ""
    assert bench.step().twist == FORWARD


def test_a_recovery_stands_still_for_somebody_and_goes_on():
    bench = Bench()
    bench.controller.fails = True
    bench.navigator.set_goal(GOAL, 0.0)
    while bench.navigator.state is not State.CLEARING:
        bench.step()
    bench.step()
    bench.someone = "someone comes this way"
    for _ in range(20):
        assert bench.step().twist == STOP
    bench.someone = ""
    assert bench.step().twist == TURN
