"""From trigger to verdict: drive to the room, look around, say what is there, come home.

Matches the tutorial's patrol_robot (a trigger of a room's sensor sends the robot there, it turns once, it comes back
to room 0; persons and fire hydrants alarm).

Differs (CONTRACTS, Settled 4 to 8; A0, quirks):
- One mission at a time, and detections count while driving, looking and returning. Triggers that arrive meanwhile
  wait, one entry a room; a trigger of the room that the robot drives to or stands in belongs to the mission that runs.
- A room that cannot be reached is reported as unreachable, and the robot does not turn elsewhere. A room that the
  points file lacks is refused.
- Every mission ends in a verdict: confirmed, clear, unreachable, or unverified where detector, camera or turn failed.
- A mission gives one notice, at its first confirmation.
"""

from __future__ import annotations

import dataclasses
import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.geometry import Pose2D, distance
from rosbot_patrol.params import param
from rosbot_patrol.patrol.drive import Drive, DriveParams
from rosbot_patrol.patrol.inputs import Goal, Inputs
from rosbot_patrol.patrol.look import Look, LookParams
from rosbot_patrol.patrol.mission import (
    Mission,
    MissionQueue,
    Phase,
    Verdict,
    mission_from_plain,
    mission_id,
    mission_to_plain,
)
from rosbot_patrol.patrol.repeats import Repeats
from rosbot_patrol.patrol.rooms import Rooms
from rosbot_patrol.patrol.spin import SpinParams
from rosbot_patrol.patrol.watch import Confirmation, Watch, WatchParams

log = logging.getLogger(__name__)

ALARM_CLASSES = ["person", "fire hydrant"]


@dataclass(frozen=True, kw_only=True)
class ManagerParams:
    """The patrol's behaviour."""

    alarm_classes: tuple[str, ...] = param(tuple(ALARM_CLASSES), doc="classes of objects that alarm")
    own_motion_radius: float = param(
        2.0, unit="m", lo=0.0, doc="on the way back, so near to its room's point, the robot is what its sensor sees"
    )
    drive: DriveParams = DriveParams()
    look: LookParams = LookParams()
    spin: SpinParams = SpinParams()
    watch: WatchParams = WatchParams()


@dataclass(frozen=True, kw_only=True)
class Report:
    """What the patrol does, and why, for people."""

    phase: Phase
    why: str
    mission: str = ""
    room_id: int = 0
    room_name: str = ""
    queue: tuple[int, ...] = ()
    last_verdict: str = ""


@dataclass(frozen=True, kw_only=True)
class Notice:
    """A confirmed intruder, the first of its mission."""

    mission: Mission
    seen: Confirmation
    phase: Phase
    pose: Pose2D | None


@dataclass(kw_only=True)
class Commands:
    """What to do after a step.

    Attributes:
        goal: to be sent; cancel: give up the goal that runs.
        speed: turning speed to command [rad/s], None where the patrol has no wish (the wheels are another's).
        report: the state, where it changed.
        notice: an intruder was confirmed: keep it, send it.
        ended: a mission that is over, back home or not.
        changed: what has to outlive the program has changed.
    """

    goal: Goal | None = None
    cancel: bool = False
    speed: float | None = None
    report: Report | None = None
    notice: Notice | None = None
    ended: Mission | None = None
    changed: bool = False


class PatrolManager:
    """The patrol as a function of time and inputs.

    Args:
        rooms: of the points file.
        params: behaviour.
        memory: what `snapshot` gave before the program ended, to go on from there.
        needs_camera: pictures come in, so that a silent camera can be told.
    """

    def __init__(
        self,
        rooms: Rooms,
        params: ManagerParams | None = None,
        *,
        memory: Mapping[str, Any] | None = None,
        needs_camera: bool = True,
    ) -> None:
        self.rooms = rooms
        self.params = params or ManagerParams()
        self.mission: Mission | None = None
        self.queue = MissionQueue()
        self.last_verdict = ""
        self._watch = Watch(tuple(self.params.alarm_classes), self.params.watch)
        self._needs_camera = needs_camera
        self._count = 0
        self._drive: Drive | None = None
        self._look: Look | None = None
        self._ready = False
        self._woke: float | None = None
        self._at_rest = "on guard"
        self._report: Report | None = None
        self._last = -math.inf
        self._repeats = Repeats()
        if memory:
            self._recall(memory)

    # -- what outlives the program

    def snapshot(self) -> dict[str, Any]:
        """What has to outlive the program, for JSON."""
        return {
            "count": self._count,
            "queue": list(self.queue.rooms),
            "mission": mission_to_plain(self.mission) if self.mission else None,
            "last_verdict": self.last_verdict,
        }

    def _recall(self, memory: Mapping[str, Any]) -> None:
        try:
            self._count = int(memory["count"])
            self.last_verdict = Verdict(memory["last_verdict"]).value if memory["last_verdict"] else ""
            for room_id in memory["queue"]:
                if self.rooms.find(int(room_id)):
                    self.queue.add(int(room_id))
            if memory["mission"]:
                self.mission = mission_from_plain(memory["mission"], self.rooms)
        except (KeyError, TypeError, ValueError) as err:
            log.warning("what was kept of the last run makes no sense (%r), starting afresh", err)
            self.mission, self.queue = None, MissionQueue()
        if self.mission:
            log.info("going on with the mission to %s where the last run stopped", self.mission.room.title)

    # -- one step

    def step(self, now: float, inputs: Inputs) -> Commands:
        """Take the inputs of this moment, decide.

        Args:
            now: time [s]; may stand still or go back.
            inputs: since the last step.
        """
        out = Commands()
        if now < self._last - 1.0:
            log.warning("time went back by %.1f s", self._last - now)
            self._watch.start(now)
        self._last = now
        self._accept(now, inputs, out)
        if self.mission is None and self._is_ready(now, inputs) and self.queue:
            self._begin(now, inputs, out)
        if self.mission is None:
            self._say(out, Phase.IDLE if self._ready else Phase.STARTING, self._rest_text(now, inputs))
            return out
        if self._drive is None and self._look is None:
            self._enter(now, self.mission.phase)
        self._watch_frames(now, inputs, out)
        if self.mission.phase is Phase.LOOKING:
            self._step_look(now, inputs, out)
        else:
            self._step_drive(now, inputs, out)
        return out

    def abandon(self, why: str) -> None:
        """Give up mission and queue, for an orderly end of the program."""
        if self.mission or self.queue:
            log.warning("the patrol ends: %s; rooms given up: %s", why, self._rooms_open())
        self.mission, self._drive, self._look, self.queue = None, None, None, MissionQueue()

    def _rooms_open(self) -> str:
        ids = ([self.mission.room.id] if self.mission else []) + list(self.queue.rooms)
        return ", ".join(map(str, ids))

    # -- triggers

    def _accept(self, now: float, inputs: Inputs, out: Commands) -> None:
        for room_id in inputs.triggers:
            room = self.rooms.find(room_id)
            if room is None:
                if self._repeats.is_news(room_id, now):
                    log.error("motion trigger refused: %s", self.rooms.refusal(room_id))
                continue
            mission = self.mission
            if mission and mission.room.id == room_id and self._answers(mission, inputs.pose):
                mission.triggers += 1
                if self._repeats.is_news(room_id, now):
                    log.info("motion in %s again, which the mission that runs answers", room.title)
            elif self.queue.add(room_id):
                log.info("motion in %s%s", room.title, ", which waits its turn" if mission else "")
                out.changed = True

    def _answers(self, mission: Mission, pose: Pose2D | None) -> bool:
        if mission.phase is not Phase.RETURNING:
            return True
        return pose is not None and distance(pose, mission.room.pose) < self.params.own_motion_radius

    def _is_ready(self, now: float, inputs: Inputs) -> bool:
        # Once on guard a trigger is taken at once: its drive waits for what is missing, within bounds.
        look = self.params.look
        silent = now - inputs.detector_at > look.detector_timeout
        if not self._ready:
            if self._woke is None or now < self._woke:
                self._woke = now
            lacks = ["move_base"] * (not inputs.link.is_up)
            lacks += ["the robot's pose in the map"] * (inputs.pose is None)
            lacks += ["its heading in odom"] * (inputs.yaw is None)
            lacks += ["the detector"] * (silent and now - self._woke < look.detector_wait)
            self._ready = not lacks
            self._at_rest = "waiting for " + " and ".join(lacks) if lacks else "on guard"
        return self._ready

    def _rest_text(self, now: float, inputs: Inputs) -> str:
        if self._ready and now - inputs.detector_at > self.params.look.detector_timeout:
            return f"{self._at_rest}; the detector is silent"
        return self._at_rest

    def _begin(self, now: float, inputs: Inputs, out: Commands) -> None:
        room_id, triggers = self.queue.pop()
        room = self.rooms.find(room_id)
        assert room is not None, "the queue holds rooms of the file only"
        self._count += 1
        self.mission = Mission(
            id=mission_id(inputs.wall, self._count), room=room, started=now, wall=inputs.wall, triggers=triggers
        )
        out.changed = True
        self._enter(now, Phase.DRIVING)

    def _enter(self, now: float, phase: Phase) -> None:
        mission = self.mission
        assert mission is not None
        if self._drive is None and self._look is None:  # it begins here, or goes on after a restart
            mission.started = now
            self._watch.start(now)
        mission.phase = phase
        self._drive = self._look = None
        if phase is Phase.LOOKING:
            self._look = Look(self.params.look, self.params.spin, needs_camera=self._needs_camera)
            return
        target = mission.room if phase is Phase.DRIVING else self.rooms.base
        name = f"{mission.id}/{phase.value}"
        self._drive = Drive(name, target.pose, self.params.drive)

    # -- phases

    def _step_drive(self, now: float, inputs: Inputs, out: Commands) -> None:
        mission, drive = self.mission, self._drive
        assert mission is not None
        assert drive is not None
        there = mission.phase is Phase.DRIVING
        step = drive.step(now, inputs.link, inputs.pose)
        out.goal, out.cancel = step.goal, step.cancel
        where = mission.room.title if there else f"home, {self._verdict_text(mission)}"
        if step.waiting:
            self._say(out, Phase.STARTING if there else Phase.RETURNING, f"waiting for move_base to drive to {where}")
        elif step.reached and there:
            mission.arrived = now
            out.changed = True
            self._enter(now, Phase.LOOKING)
            self._say(out, Phase.LOOKING, f"arrived in {mission.room.title}")
        elif step.problem and there:
            self._decide(Verdict.UNREACHABLE, f"{mission.room.title} cannot be reached: {step.problem}")
            self._go_home(now, out)
        elif step.reached or step.problem:
            self._end(out, step.problem)
        else:
            self._say(out, mission.phase, f"driving to {where}")

    def _step_look(self, now: float, inputs: Inputs, out: Commands) -> None:
        mission, look = self.mission, self._look
        assert mission is not None
        assert look is not None
        held = mission.sightings == 0 and self._watch.candidate(now)
        step = look.step(now, inputs, candidate=held)
        out.speed = step.speed
        if not step.done:
            self._say(out, Phase.LOOKING, f"{step.why}, in {mission.room.title}")
            return
        mission.looked = now
        turned = f"turned {look.turned_deg:.0f} degrees"
        if step.problem:
            self._decide(Verdict.UNVERIFIED, f"{mission.room.title} could not be verified: {step.problem}")
        else:
            self._decide(Verdict.CLEAR, f"nobody seen in {mission.room.title}, {turned}")
        self._go_home(now, out)

    def _decide(self, verdict: Verdict, reason: str) -> None:
        mission = self.mission
        assert mission is not None
        if mission.verdict is Verdict.CONFIRMED:  # nothing that comes later takes that back
            log.info(
                "%s", reason if verdict is not Verdict.CLEAR else f"the look around in {mission.room.title} is over"
            )
            return
        mission.verdict, mission.reason = verdict, reason
        (log.info if verdict is Verdict.CLEAR else log.warning)("%s", reason)

    def _go_home(self, now: float, out: Commands) -> None:
        assert self.mission is not None
        out.changed = True
        self._enter(now, Phase.RETURNING)
        self._say(out, Phase.RETURNING, f"driving home, {self._verdict_text(self.mission)}")

    def _verdict_text(self, mission: Mission) -> str:
        return f"{mission.verdict.value}: {mission.reason}" if mission.verdict else "without a verdict"

    def _end(self, out: Commands, problem: str) -> None:
        mission = self.mission
        assert mission is not None
        if mission.verdict is None:
            self._decide(Verdict.UNVERIFIED, f"{mission.room.title} was not looked at")
        assert mission.verdict is not None
        self.last_verdict = mission.verdict.value
        place = f"not at home ({problem})" if problem else "at home again"
        (log.warning if problem else log.info)("the mission to %s is over, %s", mission.room.title, place)
        self._at_rest = f"on guard, {place}; {self._verdict_text(mission)}"
        out.ended, out.changed = mission, True
        self.mission = self._drive = self._look = None
        self._say(out, Phase.IDLE, self._at_rest)

    # -- detections

    def _watch_frames(self, now: float, inputs: Inputs, out: Commands) -> None:
        mission = self.mission
        assert mission is not None
        for frame in inputs.frames:
            seen = self._watch.add(now, frame)
            if seen is None:
                continue
            mission.sightings += 1
            if mission.best is None or seen.probability > mission.best.probability:
                mission.best = seen
            if mission.verdict is not Verdict.CONFIRMED:
                where = {Phase.DRIVING: "on the way to", Phase.LOOKING: "in"}.get(mission.phase, "on the way back from")
                self._decide(
                    Verdict.CONFIRMED,
                    f"{seen.label} seen {where} {mission.room.title}, probability {seen.probability:.2f}"
                    f" over {seen.pictures} pictures",
                )
            if not mission.notified:
                mission.notified = True
                out.changed = True
                out.notice = Notice(
                    mission=dataclasses.replace(mission), seen=seen, phase=mission.phase, pose=inputs.pose
                )

    # -- what people are told

    def _say(self, out: Commands, phase: Phase, why: str) -> None:
        mission = self.mission
        report = Report(
            phase=phase,
            why=why,
            mission=mission.id if mission else "",
            room_id=mission.room.id if mission else 0,
            room_name=mission.room.name if mission else "",
            queue=self.queue.rooms,
            last_verdict=self.last_verdict,
        )
        if report != self._report:
            self._report = report
            out.report = report
