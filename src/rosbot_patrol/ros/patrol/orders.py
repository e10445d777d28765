"""Commands of people: services to cancel, come home, look at all rooms, arm, and the emergency stop."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse, Trigger, TriggerRequest, TriggerResponse

from rosbot_patrol.files import write_json
from rosbot_patrol.msg import Arming as ArmingMsg
from rosbot_patrol.patrol.guard.arming import Arming
from rosbot_patrol.patrol.guard.emergency import SERVICE, TOPIC, EmergencyStop
from rosbot_patrol.patrol.guard.modes import DISARMED
from rosbot_patrol.patrol.guard.schedule import all_rooms
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.records.commands import OwnerMessage
from rosbot_patrol.patrol.records.inputs import Guarded
from rosbot_patrol.patrol.records.request import Origin, Request
from rosbot_patrol.ros.messages import convert
from rosbot_patrol.ros.patrol.move_base import MoveBase
from rosbot_patrol.ros.runtime.callers import CallerService, caller_of
from rosbot_patrol.srv import Arm, ArmRequest, ArmResponse, Mute, MuteRequest, MuteResponse

log = logging.getLogger(__name__)

STOP_REPEAT = 0.5  # period of /e_stop while the stop is held, against a button that publishes false [s]
NOTED = "; it does not outlive a restart, as it cannot be kept: "


class StopSwitch:
    """ROS interface of the emergency stop: the service, the topic, the wheels and everybody's goals.

    Args:
        stop: state of the emergency stop.
        move_base: cancels all goals.
        cmd_vel: publisher of the immediate zero velocity.
        write_later: retries writes that the disk refused.
    """

    def __init__(
        self,
        stop: EmergencyStop,
        move_base: MoveBase,
        cmd_vel: rospy.Publisher,
        write_later: Callable[[Callable[[], None]], None],
    ) -> None:
        self._stop, self._move_base, self._cmd_vel = stop, move_base, cmd_vel
        self._write_later = write_later
        self._lock = threading.Lock()
        self._repeated_at = float("-inf")
        self._topic = rospy.Publisher("e_stop", Bool, queue_size=5, latch=True)
        rospy.Subscriber("e_stop", Bool, self._on_topic, queue_size=10, tcp_nodelay=True)
        rospy.Service("patrol/emergency_stop", SetBool, self._on_service)

    @property
    def why(self) -> str:
        """Reason why the robot must stand still, "" if it may drive."""
        return self._stop.why

    def step(self) -> None:
        """Repeat the stop message and the cancelling of goals while the stop is held."""
        if self._stop.is_held and time.monotonic() - self._repeated_at > STOP_REPEAT:
            self._hold()

    def _hold(self) -> None:
        self._repeated_at = time.monotonic()
        self._topic.publish(Bool(data=True))
        self._cmd_vel.publish(Twist())
        self._move_base.cancel_all()

    def _on_service(self, request: SetBoolRequest) -> SetBoolResponse:
        was = self._stop.is_held
        problem = self._press(bool(request.data), SERVICE)
        if request.data:
            text = "the robot stands still until the stop is released"
        else:
            text = "released" if was else "the emergency stop was not pressed"
        return SetBoolResponse(success=True, message=text + (NOTED + problem if problem else ""))

    def _on_topic(self, message: Bool) -> None:
        header = getattr(message, "_connection_header", None) or {}
        if header.get("callerid") == rospy.get_name():
            return
        self._press(bool(message.data), TOPIC)
        if self._stop.is_held and not message.data:  # another source holds it: the base's lock must hear that last
            self._topic.publish(Bool(data=True))

    def _press(self, pressed: bool, source: str) -> str:
        """Press or release; returns the problem of saving it, "" if there is none."""
        with self._lock:
            changed = self._stop.press(pressed, source)
            if self._stop.is_held and changed:
                log.warning("%s: the robot stands still", self._stop.why)
                self._hold()
            elif changed:
                log.warning("the emergency stop is released")
                self._topic.publish(Bool(data=False))
            try:
                self._stop.save()
            except OSError as err:
                log.error("the emergency stop cannot be kept: %s; trying on", err)
                self._write_later(self._save)
                return str(err)
        return ""

    def _save(self) -> None:
        with self._lock:
            self._stop.save()


class ArmingDesk:
    """ROS interface of the mode: service `/patrol/arm`, latched topic `/patrol/arming`.

    Args:
        arming: the mode.
        rooms: that can be muted.
        path: file of the mode.
        tell: accepts a message for the owner, from any thread; returns at once.
        write_later: retries writes that the disk refused.
    """

    def __init__(
        self,
        arming: Arming,
        rooms: Rooms,
        path: Path,
        tell: Callable[[OwnerMessage], None],
        write_later: Callable[[Callable[[], None]], None],
    ) -> None:
        self._arming, self._rooms, self._path = arming, rooms, path
        self._tell, self._write_later = tell, write_later
        self._lock = threading.Lock()  # protects the mode; the step needs it, so nobody holds it during disk access
        self._keeping = threading.Lock()  # protects the file: one change after the other
        self._published: Guarded | None = None
        log.log(logging.WARNING if arming.mode == DISARMED else logging.INFO, "the mode is %s", arming.mode)
        self._publisher = rospy.Publisher("patrol/arming", ArmingMsg, queue_size=5, latch=True)
        CallerService("patrol/arm", Arm, self._on_arm)
        CallerService("patrol/mute", Mute, self._on_mute)

    def step(self, calls: dict[str, int]) -> Guarded:
        """The armed rooms; `calls` are the rooms of missions, by id, started by sensors."""
        with self._lock:
            wall = time.time()
            self._arming.follow(calls, wall)
            guarded = self._arming.step(wall)
            if guarded != self._published:
                self._published = guarded
                self._publish(guarded, wall)
        return guarded

    def _on_arm(self, request: ArmRequest) -> ArmResponse:
        """Change the mode."""
        caller, wall = caller_of(request), time.time()
        what = f"arming: %s; ordered by {caller} (service /patrol/arm)"

        def tell(text: str) -> None:
            self._tell(changed_word(self._arming.mode, text, caller, wall))

        accepted, text = self._change(lambda: self._arming.arm(request.mode, wall), what, tell)
        return ArmResponse(accepted=accepted, message=text)

    def _on_mute(self, request: MuteRequest) -> MuteResponse:
        """Mute a room, or let it count again."""
        room = self._rooms.find(request.room)
        if room is None:
            return MuteResponse(accepted=False, message=self._rooms.refusal(request.room))
        what = f"muting: %s; ordered by {caller_of(request)} (service /patrol/mute)"
        accepted, text = self._change(lambda: self._arming.mute(room, request.seconds, time.time()), what, _nobody)
        return MuteResponse(accepted=accepted, message=text)

    def _change(
        self, change: Callable[[], tuple[bool, str]], said: str, tell: Callable[[str], None]
    ) -> tuple[bool, str]:
        """Change something at once; it is on disk before the answer. Returns whether it was accepted, and a sentence.

        Args:
            change: does it.
            said: for the log, with a place for the sentence.
            tell: takes the sentence if anything has changed.
        """
        with self._keeping:
            with self._lock:
                before = self._arming.snapshot()
                accepted, text = change()
                memory = self._arming.snapshot()
            (log.warning if accepted else log.error)(said, text)
            if accepted and memory != before:
                tell(text)
            problem = self._keep(memory) if accepted else ""
        return accepted, text + (NOTED + problem if problem else "")

    def _keep(self, memory: Mapping[str, Any]) -> str:
        """Save the mode; returns the problem, "" if there is none."""
        try:
            write_json(self._path, memory)
        except OSError as err:
            log.error("the mode cannot be kept: %s; trying on", err)
            self._write_later(self._save)
            return str(err)
        return ""

    def _save(self) -> None:
        with self._keeping:
            with self._lock:
                memory = self._arming.snapshot()
            write_json(self._path, memory)

    def _publish(self, guarded: Guarded, wall: float) -> None:
        message = ArmingMsg(mode=guarded.mode, all_rooms=guarded.rooms is None, quiet=guarded.is_quiet)
        message.header.stamp = convert.time_to_msg(rospy.get_time())
        message.rooms = bytes(sorted(guarded.rooms or ()))
        message.exit_delay = self._arming.exit_left(wall)
        message.entry_delay = max(guarded.holds_until - wall, 0.0) if guarded.holds_until else 0.0
        message.muted, message.muted_until = bytes(sorted(guarded.muted)), [u for _, u in sorted(guarded.muted.items())]
        message.why = guarded.why or f"the mode {guarded.mode} holds"
        self._publisher.publish(message)


def _nobody(_text: str) -> None:
    """Tell nobody."""


def changed_word(mode: str, text: str, caller: str, wall: float) -> OwnerMessage:
    """Message to the owner about a change of mode: the mode, the caller, the machine, the time."""
    when = time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(wall))
    kind = "disarmed" if mode == DISARMED else f"armed ({mode})"
    return OwnerMessage(kind=kind, text=f"{text}. Ordered by {caller}, by the service /patrol/arm, {when}")


class Orders:
    """Services that change the patrol's work, between two steps.

    Args:
        manager: manager of the missions.
        rooms: rooms of the points file.
        stepping: lock held while the manager steps.
    """

    def __init__(self, manager: PatrolManager, rooms: Rooms, stepping: threading.Lock) -> None:
        self._manager, self._rooms, self._stepping = manager, rooms, stepping
        rospy.Service("patrol/cancel", Trigger, self._cancel)
        rospy.Service("patrol/home", Trigger, self._home)
        rospy.Service("patrol/all", Trigger, self._all)

    def _cancel(self, _: TriggerRequest) -> TriggerResponse:
        with self._stepping:
            return TriggerResponse(success=True, message=self._manager.cancel())

    def _home(self, _: TriggerRequest) -> TriggerResponse:
        with self._stepping:
            return TriggerResponse(success=True, message=self._manager.go_home())

    def _all(self, _: TriggerRequest) -> TriggerResponse:
        rooms = all_rooms(self._rooms)
        with self._stepping:
            self._manager.ask([Request(room_id=room, origin=Origin.ALL, wall=time.time()) for room in rooms])
        text = f"the robot looks at the rooms {', '.join(map(str, rooms))}, those that sensors call for first"
        return TriggerResponse(success=True, message=text)
