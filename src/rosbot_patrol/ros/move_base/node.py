"""The node move_base (matches move_base 1.17 with costmap_2d, navfn and base_local_planner as their ROS interface).

Differs:
    - Planning runs on a copy of the global costmap: neither the control cycle nor the costmap waits for it. The control
      cycle drives by the local costmap's last update, and does not wait for the one that is under way.
    - Cancelling works inside recovery behaviours, and at once whatever the controller's frequency.
    - When a node has died that the pose comes from (amcl, the base), the robot stands at once, not only when its last
      transform is too old; with `stop_without_map` it also stands while the map server is down.
    - Scans that say nothing, or of a laser that is tilted, stop the robot as old sensor data do, and are named.
    - Odometry that is older than `odom_timeout` stops the robot (upstream drives on with the last velocity).
    - A goal in a frame that tf does not know is aborted at once with the planner's text, instead of after recoveries.
    - It stands still for somebody whose way it would cross, and goes on when they have passed (`~give_way`).
    - Topics that nobody listens to are not built.
    - dynamic_reconfigure: see `move_base_tuning`.
"""

from __future__ import annotations

import logging
import threading
from dataclasses import replace
from typing import Any

import rospy
from nav_msgs.msg import Odometry
from nav_msgs.srv import GetPlan, GetPlanRequest, GetPlanResponse
from std_srvs.srv import Empty, EmptyRequest, EmptyResponse

from rosbot_patrol.costmap.params import read_costmap
from rosbot_patrol.errors import ParamError, PlanningError, TransformError
from rosbot_patrol.geometry import STOP, Pose2D, Twist2D
from rosbot_patrol.navigation.interfaces import NavigatorView, Outcome, State
from rosbot_patrol.navigation.navigator import Navigator
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.planning.interfaces import LocalView, Recovery, RecoveryView
from rosbot_patrol.planning.registry import make_global_planner, make_local_planner, make_recoveries, short_name
from rosbot_patrol.ros.messages.convert import path_to_msg, twist_from_msg
from rosbot_patrol.ros.move_base.costmap import CostmapNode
from rosbot_patrol.ros.move_base.goals import GoalRefusedError, GoalServer, read_pose
from rosbot_patrol.ros.move_base.movers import People
from rosbot_patrol.ros.move_base.outputs import HealthTeller, Outputs
from rosbot_patrol.ros.move_base.plans import ThreadedPlans
from rosbot_patrol.ros.move_base.tuning import Tuning
from rosbot_patrol.ros.runtime.latest import Latest
from rosbot_patrol.ros.runtime.logs import LineThrottle
from rosbot_patrol.ros.runtime.node import Loop, load_params, now, run_node
from rosbot_patrol.ros.runtime.process import Priority, give_back_large_blocks
from rosbot_patrol.ros.runtime.transforms import Transforms

log = logging.getLogger(__name__)

_REPEAT_S = 10.0  # between two lines of one kind
_NORMAL = ("waiting", "planning after", "recovering")  # reasons that belong to a drive
_CLOCK_NOISE = 1e-4  # of differences of times as floats [s]


def _group(tree: dict[str, Any], key: str) -> dict[str, Any]:
    group = tree.get(key, {})
    if not isinstance(group, dict):
        raise ParamError(f"{rospy.get_name()}/{key}", f"expected a group of parameters, got {group!r}")
    return group


class MoveBaseNode:
    """Reads inputs, steps the navigator, publishes what it commands."""

    def __init__(self) -> None:
        tree: dict[str, Any] = rospy.get_param("~", {}) or {}
        groups = [key for key, value in tree.items() if isinstance(value, dict)]
        self.params = load_params(MoveBaseParams, tree=tree, ignore=[*groups, "recovery_behaviors"])
        name = rospy.get_name() + "/"
        self._tree, self._name = tree, name
        self._cycle = threading.RLock()
        self._transforms = Transforms()
        self._global = self._make_costmap(tree, "global_costmap", name)
        self._local = self._make_costmap(tree, "local_costmap", name, keeps_last=True)
        p = self.params
        self._planner = make_global_planner(p.base_global_planner, tree, name=name)
        self._plans = ThreadedPlans(self._planner, self._global)
        self._controller = make_local_planner(
            p.base_local_planner,
            tree,
            self._local.costmap,
            controller_frequency=p.controller_frequency,
            name=name,
        )
        self._navigator = Navigator(
            p, plans=self._plans, controller=self._controller, recoveries=self._make_recoveries(p)
        )
        self._people = People(self._scan_topic(), self._local.frame, self._transforms, p.movers, p.give_way)
        self._velocity: Latest[Twist2D] = Latest()
        self._slow_cycles = 0
        self._said = ""
        self._repeats = LineThrottle(_REPEAT_S)
        self._control = Loop(p.controller_frequency, self.step, name="control")
        self._advertise()
        self._offer_tuning()

    def _make_recoveries(self, p: MoveBaseParams) -> list[Recovery]:
        return make_recoveries(
            self._tree,
            conservative=p.conservative_reset_dist,
            clearing_radius=p.aggressive_radius,
            clearing_rotation=p.clearing_rotation_allowed,
            name=self._name,
            planner=self._controller,
        )

    def _offer_tuning(self) -> None:
        tuning = Tuning(self._name, self._cycle)
        tuning.offer_node(self.params, self._configure)
        tuning.offer_planner(short_name(self.params.base_global_planner), self._planner)
        tuning.offer_planner(short_name(self.params.base_local_planner), self._controller)
        tuning.offer_costmap(self._global, lambda: None)
        tuning.offer_costmap(self._local, self._fit_controller)

    def _configure(self, params: MoveBaseParams) -> None:
        self.params = params
        self._navigator.configure(params, self._make_recoveries(params))
        self._control.set_rate(params.controller_frequency)
        if "controller_frequency" not in _group(self._tree, short_name(params.base_local_planner)):
            own = replace(self._controller.params, controller_frequency=params.controller_frequency)
            self._controller.set_params(own)

    def _fit_controller(self) -> None:
        costmap = self._local.costmap
        self._controller.fit(costmap.footprint, resolution=costmap.info.resolution)

    def _scan_topic(self) -> str:
        """Where the local costmap's first scans come from, "" where it takes none."""
        for layer in self._local.costmap.obstacle_layers:
            for key, buffer in layer.buffers.items():
                if buffer.params.data_type == "LaserScan":
                    return buffer.params.topic or key
        return ""

    def _make_costmap(self, tree: dict[str, Any], key: str, name: str, *, keeps_last: bool = False) -> CostmapNode:
        config = read_costmap(_group(tree, key), name=f"{name}{key}/")
        return CostmapNode(config, self._transforms, key, keeps_last=keeps_last)

    def _advertise(self) -> None:
        p = self.params
        global_name, local_name = short_name(p.base_global_planner), short_name(p.base_local_planner)
        frames = {"global_frame": self._global.frame, "local_frame": self._local.frame}
        self._outputs = Outputs(global_name, local_name, **frames)
        self._health = HealthTeller((self._global, self._local))
        self._goals = GoalServer(self._global.frame, self._transforms, self._control.hurry)
        rospy.Subscriber(p.odom_topic, Odometry, self._on_odom, queue_size=1, tcp_nodelay=True)
        rospy.Service("~make_plan", GetPlan, self._on_make_plan)
        rospy.Service(f"~{global_name}/make_plan", GetPlan, self._on_planner_make_plan)
        rospy.Service("~clear_costmaps", Empty, self._on_clear)
        rospy.on_shutdown(self._stop)

    def run(self) -> None:
        """Until shutdown."""
        self._global.start()
        self._local.start()
        self._goals.start()
        self._control.start()
        log.info("move_base takes goals in frame '%s'", self._global.frame)
        self._tell_reach()
        rospy.spin()

    def _tell_reach(self) -> None:
        """Say how far goals may be where the global costmap moves with the robot, as with the tutorial's values."""
        shape = self._global.params
        if shape.rolling_window:
            log.warning(
                "the global costmap is a window of %.0f x %.0f m that moves with the robot: goals that lie farther than"
                " %.1f m along x or %.1f m along y cannot be planned to (width and height of global_costmap)",
                shape.width, shape.height, shape.width / 2.0, shape.height / 2.0,
            )  # fmt: skip

    def _stop(self) -> None:
        if self._navigator.state is not State.IDLE:
            self._outputs.send(STOP)

    # ---- inputs

    def _on_odom(self, msg: Odometry) -> None:
        self._velocity.set(twist_from_msg(msg.twist.twist), now())

    def _on_clear(self, request: EmptyRequest) -> EmptyResponse:
        for costmap in (self._global, self._local):
            with costmap.lock:
                costmap.costmap.reset()
        return EmptyResponse()

    def _on_make_plan(self, request: GetPlanRequest) -> GetPlanResponse | None:
        if self._goals.is_active:
            log.error("move_base must be in an inactive state to make a plan for an external user")
            return None
        return self._on_planner_make_plan(request)

    def _on_planner_make_plan(self, request: GetPlanRequest) -> GetPlanResponse | None:
        try:
            if request.start.header.frame_id:
                start = read_pose(request.start, self._global.frame, self._transforms)
            else:
                start = self._global.robot_pose(now())
            goal = read_pose(request.goal, self._global.frame, self._transforms)
        except (GoalRefusedError, TransformError) as err:
            log.error("make_plan: %s", err)
            return None
        response = GetPlanResponse()
        response.plan.header.frame_id = self._global.frame
        try:
            poses = self._plans.plan(start, goal, tolerance=request.tolerance)
        except PlanningError as err:
            log.error("make_plan: %s", err)
            return response
        response.plan = path_to_msg(poses, self._global.frame, now())
        return response

    # ---- the control cycle

    def step(self, time: float) -> None:
        """One control cycle."""
        with self._cycle:
            self._step(time)

    def _step(self, time: float) -> None:
        goal = self._goals.take(time)
        if goal is not None:
            if self._navigator.state is State.IDLE:
                self._outputs.send(STOP)
            self._navigator.set_goal(goal, time)
        if self._navigator.state is State.IDLE:
            self._tell(time)
            return
        if not self._goals.is_active:  # refused or replaced by one that was refused
            self._outputs.publish(self._navigator.cancel(), self._controller, time)
            return
        if self._goals.is_cancelled:
            self._outputs.publish(self._navigator.cancel(), self._controller, time)
            self._goals.preempt()
            return
        self._work(time)

    def _work(self, time: float) -> None:
        self._people.look()
        view, problem = self._view(time)
        if self._navigator.state is State.CLEARING:
            with self._global.lock, self._local.lock:
                command = self._navigator.step(time, view)
        else:
            command = self._navigator.step(time, view)
        self._outputs.publish(command, self._controller, time)
        self._say(problem or command.reason, command.outcome)
        if view is not None:
            self._goals.feedback(view.recovery.pose_global, time)
        if command.outcome is not None:
            self._goals.finish(command.outcome)
        self._watch_rate(time)
        self._tell(time)

    def _say(self, reason: str, outcome: Outcome | None) -> None:
        """Log why the base does not simply drive; the end of a goal always, another reason once in a while."""
        kind = reason.split(":")[0]  # what follows has figures that change
        is_told = reason == self._navigator.plan_failure or kind.startswith("recovery ")  # by the navigator
        is_new = kind not in ("", "driving", "planning", self._said) and not is_told
        self._said = kind
        more = "" if outcome is not None else self._repeats.due(kind, now()) if is_new else None
        if more is not None:
            is_normal = outcome.succeeded if outcome is not None else kind.startswith(_NORMAL)
            log.log(logging.INFO if is_normal else logging.WARNING, "%s%s", reason, more)

    def _departed(self) -> str:
        """Which other node that it cannot drive without has gone, in a sentence; else empty."""
        gone = self._transforms.departed(self._local.base_frame)
        if not gone and self.params.stop_without_map:
            topic = self._global.departed_map or self._local.departed_map
            gone = f"nobody publishes the map on {topic} any more" if topic else ""
        return gone

    def _view(self, time: float) -> tuple[NavigatorView | None, str]:
        """What the navigator sees, None and why where it must not drive by it: the robot's pose is not known."""
        gone = self._departed()
        if gone:
            return None, gone
        try:
            pose_global = self._global.robot_pose(time)
            pose_local = self._local.robot_pose(time)
            frames = self._local.frame, self._global.frame
            local_from_plan = Pose2D() if frames[0] == frames[1] else self._transforms.lookup(*frames)
        except TransformError as err:
            return None, str(err)
        timeout = self.params.odom_timeout
        moving_known = timeout == 0.0 or self._velocity.fresh(time, timeout)
        local = LocalView(
            now=time,
            pose=pose_local,
            velocity=self._velocity.get() or STOP,
            costmap=self._local.last,
            local_from_plan=local_from_plan,
        )
        recovery = RecoveryView(
            now=time,
            pose_global=pose_global,
            pose_local=pose_local,
            global_costmap=self._global.costmap,
            local_costmap=self._local.costmap,
        )
        problem = "" if moving_known else f"no odometry on {self.params.odom_topic} for {timeout} s"
        if not self._local.is_current(time):
            problem = "Sensor data is out of date, we're not going to allow commanding of the base for safety"
            problem = ": ".join([problem, *self._local.troubles(time)])
        view = NavigatorView(
            local=local,
            recovery=recovery,
            is_current=not problem,
            must_wait=lambda wish: self._people.waits(wish, pose_local, time),
        )
        return view, problem

    def _watch_rate(self, time: float) -> None:
        took = now() - time
        if took > 1.0 / self.params.controller_frequency + _CLOCK_NOISE:
            self._slow_cycles += 1
            more = self._repeats.due("slow cycle", time)
            if more is not None:
                log.warning(
                    "Control loop missed its desired rate of %.4fHz... the loop actually took %.4f seconds%s",
                    self.params.controller_frequency,
                    took,
                    more,
                )

    def _tell(self, time: float) -> None:
        self._health.tell(time, self._navigator.state, self._navigator.reason, self._slow_cycles)


def main() -> None:
    """Start the node."""
    give_back_large_blocks()
    run_node("move_base", lambda: MoveBaseNode().run(), priority=Priority.CONTROL)
