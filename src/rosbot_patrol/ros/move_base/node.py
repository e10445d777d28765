"""The node move_base (matches move_base 1.17 with costmap_2d, navfn and base_local_planner in its ROS interface).

Differs:
- Planning runs on a copy of the global costmap: neither the control cycle nor the costmap waits for it. The control
  cycle uses the local costmap's last update, and does not wait for the running one.
- Cancelling works inside recovery behaviours, and at once whatever the controller's frequency.
- If a node that the pose depends on (amcl, the base) dies, the robot stops at once, not only when the last transform is
  too old. With `stop_without_map` it also stops while the map server is down.
- Scans without information, or from a tilted laser, stop the robot like old sensor data, and are reported.
- Odometry older than `odom_timeout` stops the robot (upstream drives on with the last velocity).
- A goal in a frame unknown to tf is aborted at once with the planner's text, instead of after recoveries.
- The robot gives way to people: it waits until they have passed (`~give_way`).
- Topics without subscribers are not built.
- dynamic_reconfigure: see `move_base.tuning`.
"""

from __future__ import annotations

import logging
import threading
from typing import Any

import rospy
from nav_msgs.msg import Odometry
from nav_msgs.srv import GetPlan, GetPlanRequest, GetPlanResponse
from sensor_msgs.msg import LaserScan as LaserScanMsg
from std_srvs.srv import Empty, EmptyRequest, EmptyResponse

from rosbot_patrol.errors import PlanningError, TransformError
from rosbot_patrol.geometry import STOP
from rosbot_patrol.navigation.interfaces import Outcome, Reason, State
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.navigation.stack import Cycle, NavigationStack
from rosbot_patrol.planning.registry import short_name
from rosbot_patrol.ros.messages.convert import path_to_msg, scan_from_msg, twist_from_msg
from rosbot_patrol.ros.move_base.costmap import CostmapNode
from rosbot_patrol.ros.move_base.goals import GoalRefusedError, GoalServer, read_pose
from rosbot_patrol.ros.move_base.outputs import HealthTeller, Outputs
from rosbot_patrol.ros.move_base.plans import ThreadedPlans
from rosbot_patrol.ros.move_base.tuning import Tuning
from rosbot_patrol.ros.runtime.logs import LineThrottle
from rosbot_patrol.ros.runtime.node import Loop, now, run_node
from rosbot_patrol.ros.runtime.process import Priority
from rosbot_patrol.ros.runtime.state_folder import zones_file
from rosbot_patrol.ros.runtime.transforms import Transforms

log = logging.getLogger(__name__)

_REPEAT_S = 10.0  # between two lines of one kind
_NORMAL = {Reason.WAITING, Reason.RECOVERING, Reason.RECOVERED}  # reasons of a normal drive
_LOGGED_ELSEWHERE = {Reason.NO_PLAN, Reason.RECOVERY}  # the navigator logs them
_NO_NEWS = {Reason.DRIVING, Reason.PLANNING, *_LOGGED_ELSEWHERE}
_WITH_FIGURES = {Reason.WAITING, Reason.POSE_UNKNOWN, Reason.SENSORS_OLD}  # their sentences change all the time
_CLOCK_NOISE = 1e-4  # tolerance for differences of times as floats [s]


class MoveBaseNode:
    """The topics, services, actions and threads of a NavigationStack."""

    def __init__(self) -> None:
        tree: dict[str, Any] = rospy.get_param("~", {}) or {}
        self._name = rospy.get_name() + "/"
        self._cycle = threading.RLock()
        self._transforms = Transforms()
        zones = zones_file(str(tree.get("zones_file", "")), rospy.get_namespace())
        self._stack = NavigationStack(tree, self._transforms, ThreadedPlans, name=self._name, now=now(), zones=zones)
        self._stack.departed = self._departed
        self._navigator, self._controller = self._stack.navigator, self._stack.controller
        self._global, self._local = (CostmapNode(costmap) for costmap in self._stack.costmaps)
        self._frame = self._stack.global_costmap.frame
        self._slow_cycles = 0
        self._said = ""
        self._repeats = LineThrottle(_REPEAT_S)
        self._control = Loop(self._stack.params.controller_frequency, self.step, name="control")
        self._advertise()
        self._subscribe()
        self._offer_tuning()

    def _offer_tuning(self) -> None:
        p, stack = self._stack.params, self._stack
        tuning = Tuning(self._name, self._cycle)
        tuning.offer_node(p, self._configure)
        tuning.offer_planner(short_name(p.base_global_planner), stack.planner)
        tuning.offer_planner(short_name(p.base_local_planner), stack.controller)
        tuning.offer_costmap(self._global, lambda: None)
        tuning.offer_costmap(self._local, stack.fit_controller)

    def _configure(self, params: MoveBaseParams) -> None:
        self._stack.configure(params)
        self._control.set_rate(params.controller_frequency)

    def _advertise(self) -> None:
        p = self._stack.params
        global_name, local_name = short_name(p.base_global_planner), short_name(p.base_local_planner)
        frames = {"global_frame": self._frame, "local_frame": self._stack.local_costmap.frame}
        self._outputs = Outputs(global_name, local_name, **frames)
        self._health = HealthTeller(self._stack.costmaps)
        self._goals = GoalServer(self._frame, self._transforms, self._control.hurry)
        rospy.Service("~make_plan", GetPlan, self._on_make_plan)
        rospy.Service(f"~{global_name}/make_plan", GetPlan, self._on_planner_make_plan)
        rospy.Service("~clear_costmaps", Empty, self._on_clear)
        rospy.on_shutdown(self._stop)

    def _subscribe(self) -> None:
        p, topic = self._stack.params, self._stack.scan_topic
        rospy.Subscriber(p.odom_topic, Odometry, self._on_odom, queue_size=1, tcp_nodelay=True)
        if topic and p.give_way.horizon > 0.0:
            rospy.Subscriber(topic, LaserScanMsg, self._on_scan, queue_size=1, buff_size=2**18, tcp_nodelay=True)

    def run(self) -> None:
        """Run until shutdown."""
        self._global.start()
        self._local.start()
        self._goals.start()
        self._control.start()
        log.info("move_base takes goals in frame '%s'", self._frame)
        self._tell_reach()
        rospy.spin()

    def _tell_reach(self) -> None:
        """Log how far goals may be if the global costmap moves with the robot, as with the tutorial's values."""
        shape = self._stack.global_costmap.params
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
        self._stack.hear_velocity(twist_from_msg(msg.twist.twist), now())

    def _on_scan(self, msg: LaserScanMsg) -> None:
        self._stack.people.hear(scan_from_msg(msg))

    def _on_clear(self, request: EmptyRequest) -> EmptyResponse:
        for costmap in self._stack.costmaps:
            costmap.reset()
        return EmptyResponse()

    def _on_make_plan(self, request: GetPlanRequest) -> GetPlanResponse | None:
        if self._goals.is_active:
            log.error("move_base must be in an inactive state to make a plan for an external user")
            return None
        return self._on_planner_make_plan(request)

    def _on_planner_make_plan(self, request: GetPlanRequest) -> GetPlanResponse | None:
        try:
            if request.start.header.frame_id:
                start = read_pose(request.start, self._frame, self._transforms)
            else:
                start = self._stack.global_costmap.robot_pose(now())
            goal = read_pose(request.goal, self._frame, self._transforms)
        except (GoalRefusedError, TransformError) as err:
            log.error("make_plan: %s", err)
            return None
        response = GetPlanResponse()
        response.plan.header.frame_id = self._frame
        try:
            poses = self._stack.plan(start, goal, tolerance=request.tolerance)
        except PlanningError as err:
            log.error("make_plan: %s", err)
            return response
        response.plan = path_to_msg(poses, self._frame, now())
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
        if not self._goals.is_active:  # refused, or replaced by a refused one
            self._outputs.publish(self._navigator.cancel(), self._controller, time)
            return
        if self._goals.is_cancelled:
            self._outputs.publish(self._navigator.cancel(), self._controller, time)
            self._goals.preempt()
            return
        self._work(time)

    def _work(self, time: float) -> None:
        cycle = self._stack.step(time)
        command = cycle.command
        self._outputs.publish(command, self._controller, time)
        self._say(cycle, command.outcome)
        if cycle.pose is not None:
            self._goals.feedback(cycle.pose, time)
        if command.outcome is not None:
            self._goals.finish(command.outcome)
        self._watch_rate(time)
        self._tell(time)

    def _say(self, cycle: Cycle, outcome: Outcome | None) -> None:
        """Log why the base does not simply drive; the end of a goal always, other reasons at most once per period."""
        reason = cycle.reason
        kind = reason.value if reason in _WITH_FIGURES else cycle.text
        is_new = reason not in _NO_NEWS and kind != self._said
        self._said = kind
        more = "" if outcome is not None else self._repeats.due(kind, now()) if is_new else None
        if more is not None:
            is_normal = outcome.succeeded if outcome is not None else reason in _NORMAL
            log.log(logging.INFO if is_normal else logging.WARNING, "%s%s", cycle.text, more)

    def _departed(self) -> str:
        """Another necessary node that has died, as a sentence; else empty."""
        gone = self._transforms.departed(self._stack.local_costmap.base_frame)
        if not gone and self._stack.params.stop_without_map:
            topic = self._global.departed_map or self._local.departed_map
            gone = f"nobody publishes the map on {topic} any more" if topic else ""
        return gone

    def _watch_rate(self, time: float) -> None:
        took = now() - time
        if took > 1.0 / self._stack.params.controller_frequency + _CLOCK_NOISE:
            self._slow_cycles += 1
            more = self._repeats.due("slow cycle", time)
            if more is not None:
                log.warning(
                    "Control loop missed its desired rate of %.4fHz... the loop actually took %.4f seconds%s",
                    self._stack.params.controller_frequency,
                    took,
                    more,
                )

    def _tell(self, time: float) -> None:
        self._health.tell(time, self._navigator.state, self._navigator.text, self._slow_cycles)


def main() -> None:
    """Start the node."""
    run_node("move_base", lambda: MoveBaseNode().run(), priority=Priority.CONTROL)
