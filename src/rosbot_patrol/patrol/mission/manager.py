"""From trigger to verdict: drive to the room, look around, say what is there, come home.

Matches the tutorial's patrol_robot (a trigger of a room's sensor sends the robot there, it turns once, it comes back
to room 0; persons and fire hydrants alarm).

Differs (CONTRACTS, Settled 4 to 8; A0, quirks):
- One mission at a time, and detections count while driving, looking and returning. Calls that arrive meanwhile wait,
  one entry a room, the most urgent first (`queueing`); which of them are answered already, are the robot's own doing or
  are not armed, `intake` decides. From a mission that is on its way home the robot goes on to the next room at once.
- A room whose point cannot be reached is looked at from another viewpoint (`phases`); one that has none that can be is
  reported as unreachable, and the robot does not turn elsewhere. A room that the points file lacks is refused; one with
  a point off the map's floor is unverified, without a drive.
- Every mission ends in a verdict: confirmed, clear, unreachable, or unverified where detector, camera or turn failed,
  the battery or the emergency stop ended it, or a person did.
- A mission gives one notice, at its first confirmation, and one more for each further person elsewhere (`people`).
- While a person is in view the robot stops and keeps the camera on them, for a bounded time (`track`).
- All times and stamps of a mission are steady (`steady`): a clock that is set ends nothing and loses no evidence.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Mapping
from typing import Any

from rosbot_patrol.patrol.guard.battery import BatteryWatch
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.intruder.exclusions import Judge
from rosbot_patrol.patrol.intruder.frozen_camera import SamePictures
from rosbot_patrol.patrol.mission import resume as recall
from rosbot_patrol.patrol.mission.mission_run import Viewpoints
from rosbot_patrol.patrol.mission.orders import Ordered
from rosbot_patrol.patrol.mission.params import ManagerParams
from rosbot_patrol.patrol.mission.phases import Views
from rosbot_patrol.patrol.mission.steady import Heard
from rosbot_patrol.patrol.records.commands import Commands, Word
from rosbot_patrol.patrol.records.inputs import Frame, Inputs, ScanView
from rosbot_patrol.patrol.records.mission import Mission, Phase, Verdict
from rosbot_patrol.patrol.records.request import Origin, Request

log = logging.getLogger(__name__)


class PatrolManager(Ordered):
    """The patrol as a function of time and inputs: which mission runs when.

    Args:
        rooms: of the points file.
        params: behaviour.
        memory: what `snapshot` gave before the program ended, to go on from there.
        needs_camera, views, viewpoints, judge: see `Conduct`.
    """

    def __init__(
        self,
        rooms: Rooms,
        params: ManagerParams | None = None,
        *,
        memory: Mapping[str, Any] | None = None,
        needs_camera: bool = True,
        views: Views | None = None,
        viewpoints: Viewpoints | None = None,
        judge: Judge | None = None,
    ) -> None:
        super().__init__(
            rooms, params or ManagerParams(), needs_camera=needs_camera, views=views, viewpoints=viewpoints, judge=judge
        )
        self._heard = {name: Heard(self._clock) for name in ("detector_at", "camera_at", "camera_changed_at")}
        self._battery_heard = Heard(self._clock)
        self._scan: tuple[ScanView, ScanView] | None = None  # as it came, and in steady time
        self._battery = BatteryWatch(self.params.battery)
        self._same_pictures = SamePictures()
        self._homes_tried = 0
        self._is_first = True
        self._is_stopped = False
        self._told: dict[str, str] = {}  # by the id of a call that waits
        if memory:
            recall.recall(self, self._intake, memory)

    def note_told(self, mission_id: str, reason: str, *, held_until: float | None = None) -> bool:
        """The notice of a mission is on disk from before the program's start; the memory may be older than that.

        Args:
            mission_id: of the mission that runs or of a call that waits.
            reason: what the notice says, one sentence.
            held_until: where it waits for the entry delay: at the latest until then, in seconds since 1970.

        Returns:
            Whether it was news: then the mission is confirmed.
        """
        if self.mission is None or self.mission.id != mission_id:
            self._told[mission_id] = reason
        elif self.mission.notified:
            return False
        else:
            recall.confirm(self.mission, reason)
        if held_until is not None:
            self.held.setdefault(mission_id, held_until)
        return True

    @property
    def is_resting(self) -> bool:
        """Whether only what it hears sets it in motion: nothing is under way, and nothing waits for a moment."""
        is_free = self.mission is None and self._home is None and not self.queue and not self.held
        return is_free and self._ready.is_ready and not self._is_stopped

    def snapshot(self) -> dict[str, Any]:
        """What has to outlive the program, for JSON."""
        return recall.snapshot(self, self._intake)

    # -- one step

    def step(self, now: float, inputs: Inputs) -> Commands:
        """Take the inputs of this moment, decide.

        Args:
            now: time [s]; may stand still, go back or jump.
            inputs: since the last step.
        """
        out, self._pending = self._pending, Commands()
        passed = self._pass_time(now)
        inputs = dataclasses.replace(inputs, frames=self._same_pictures.left(inputs.frames))
        inputs = self._inputs = self._in_steady_time(inputs)
        time = self._clock.time
        self._own_motion.see(time, inputs.pose, awake=not self._is_blind(inputs))
        self._release(inputs, out)
        self._take(inputs, out)
        if self._is_first:
            self._is_first = False
            self._drop_the_old(inputs, out)
        self._mind_the_battery(inputs, out)
        if inputs.stop:
            self._hold_still(inputs, out)
            return out
        if self._is_stopped:
            self._is_stopped = False
            out.words += (Word(kind="emergency stop", text="the emergency stop is released", is_over=True),)
        self._choose(time, inputs, out)
        if self.mission is None:
            self._rest(time, inputs, out)
            return out
        self._leave_out_off_the_map(inputs, out)
        self._count(passed, inputs)
        self._watch_frames(inputs, out)
        if self.mission.phase is not Phase.RETURNING:
            self._views.see(self._clock.time, inputs)
            self.mission.share_seen = self._views.share()
        if self._keep_in_view(inputs, out):
            return out
        if self.mission.phase is Phase.LOOKING:
            self._step_look(inputs, out)
        else:
            self._step_drive(inputs, out)
        return out

    def _pass_time(self, now: float) -> float:
        passed = self._clock.step(now)
        if self._clock.jump:
            direction = "back" if self._clock.jump < 0.0 else "forward"
            log.warning("time went %s by %.1f s", direction, abs(self._clock.jump))
        return passed

    def _in_steady_time(self, inputs: Inputs) -> Inputs:
        """The inputs, with every stamp in steady time: the only place that knows of another."""
        steady: dict[str, Any] = {name: heard.steady(getattr(inputs, name)) for name, heard in self._heard.items()}
        steady["frames"] = tuple(self._steady_frame(frame) for frame in inputs.frames)
        if inputs.battery is not None:
            at = self._battery_heard.steady(inputs.battery.at)
            steady["battery"] = dataclasses.replace(inputs.battery, at=at)
        if inputs.scan is not None:
            steady["scan"] = self._steady_scan(inputs.scan)
        return dataclasses.replace(inputs, **steady)

    def _steady_scan(self, view: ScanView) -> ScanView:
        if self._scan is None or self._scan[0] is not view:
            scan = dataclasses.replace(view.scan, stamp=self._clock.steady(view.scan.stamp))
            self._scan = view, dataclasses.replace(view, scan=scan)
        return self._scan[1]

    def _steady_frame(self, frame: Frame) -> Frame:
        if frame.stamp is None:
            return dataclasses.replace(frame, picture=self._clock.now)
        return dataclasses.replace(frame, stamp=self._clock.steady(frame.stamp), picture=frame.stamp)

    def _is_blind(self, inputs: Inputs) -> bool:
        look = self.params.look
        silent = self._clock.time - inputs.detector_at > look.detector_timeout
        return silent or (self._parts.needs_camera and self._clock.time - inputs.camera_at > look.camera_timeout)

    def _take(self, inputs: Inputs, out: Commands) -> None:
        watching = self._watch.candidate(self._clock.time)
        taken = self._intake.take(self._clock.time, inputs, self.mission, has_candidate=watching)
        out.changed |= taken.changed
        out.ignored += taken.ignored
        if inputs.guarded.mode == "disarmed":
            self._stand_down(inputs, out)

    # -- what to do next

    def _choose(self, time: float, inputs: Inputs, out: Commands) -> None:
        """End, put back or begin missions."""
        mission = self.mission
        ready = self._ready.step(time, inputs)
        if mission and self._trip is None and self._look is None:
            self._go_on(inputs)
        if not self.queue or self._battery.is_low:
            return
        following = next(iter(self.queue))
        if mission and mission.phase is Phase.RETURNING:
            self._end(out, f"going on to {self._title(following.room_id)}")
        elif mission and self._may_wait(mission, following):
            self._put_back(mission, following, out)
        elif mission is None and ready:
            self._begin(inputs, out)

    def _may_wait(self, mission: Mission, other: Request) -> bool:
        """Whether a mission is put back for another: for a sensor's call, where nobody was seen yet."""
        return (
            self.params.priorities.preempt
            and mission.origin is not Origin.TRIGGER
            and other.origin is Origin.TRIGGER
            and other.priority > mission.priority
            and mission.verdict is None
        )

    def _put_back(self, mission: Mission, other: Request, out: Commands) -> None:
        log.info("%s is put back: motion in %s", mission.room.title, self._title(other.room_id))
        self.queue.put_back(
            Request(
                room_id=mission.room.id,
                origin=mission.origin,
                note=mission.note,
                wall=mission.called,
                priority=mission.priority,
                id=mission.id,
                triggers=mission.triggers,
                times=mission.times,
            )
        )
        self._leave(out)
        self._ready.at_rest = (
            f"on guard; {mission.room.title} is put back, as the sensor of {self._title(other.room_id)} calls"
        )

    def _title(self, room_id: int) -> str:
        room = self.rooms.find(room_id)
        return room.title if room else f"room {room_id}"

    def _begin(self, inputs: Inputs, out: Commands) -> None:
        self.mission = recall.begin(self.queue.pop(), self.rooms, inputs.wall)
        if self.mission.id in self._told:
            recall.confirm(self.mission, self._told.pop(self.mission.id))
        self._home = None
        out.changed = True
        self._start(inputs, Phase.DRIVING)

    def _rest(self, time: float, inputs: Inputs, out: Commands) -> None:
        low = self._battery.is_low
        if low and self._home is None and self._homes_tried == 0 and not self._is_home(inputs):
            self._homes_tried += 1
            self._drive_home()
        if self._home is not None:
            self._step_home(time, inputs, out)
            return
        phase = Phase.IDLE if self._ready.is_ready else Phase.STARTING
        self._say(
            out, phase, f"waiting for the battery, which is low ({self._battery.text})" if low else self._ready.text
        )

    # -- what ends a mission early

    def _leave_out_off_the_map(self, inputs: Inputs, out: Commands) -> None:
        """A room with a point off the map: the robot would look at another place and call that one clear."""
        mission = self.mission
        if mission is None or inputs.house is None or mission.phase is Phase.RETURNING:
            return
        problem = inputs.house.refusal(mission.room)
        if not problem:
            return
        self._decide(Verdict.UNVERIFIED, f"{mission.room.title} was not looked at: {problem}")
        if mission.origin is Origin.TRIGGER:
            text = f"motion in {mission.room.title}, which cannot be looked at: {problem}"
            out.words += (Word(kind=f"room {mission.room.id}", text=text),)
        out.cancel = True
        self._turn_home(inputs, out)

    def _mind_the_battery(self, inputs: Inputs, out: Commands) -> None:
        if self._battery.step(self._clock.time, inputs.battery):
            low = self._battery.is_low
            text = f"the battery is low ({self._battery.text}): the robot goes home and waits there"
            text = text if low else f"the battery is no longer low ({self._battery.text})"
            (log.warning if low else log.info)("%s", text)
            out.words += (Word(kind="battery", text=text, is_over=not low),)
            self._homes_tried = 0
        mission = self.mission
        if self._battery.is_low and mission and mission.phase is not Phase.RETURNING:
            title, text = mission.room.title, self._battery.text
            self._decide(Verdict.UNVERIFIED, f"{title} was not looked at to the end: the battery is low ({text})")
            self._turn_home(inputs, out)

    def _hold_still(self, inputs: Inputs, out: Commands) -> None:
        """The emergency stop is pressed."""
        if not self._is_stopped:
            self._is_stopped = True
            out.cancel = out.cancel_all = True
            out.words += (Word(kind="emergency stop", text=f"{inputs.stop}: nobody looks until it is released"),)
        self._home = None
        out.goal, out.speed = None, 0.0
        if self.mission:
            title = self.mission.room.title
            self._decide(Verdict.UNVERIFIED, f"{title} was not looked at to the end: {inputs.stop}")
            self._end(out, "where it was stopped")
        self._ready.at_rest = "on guard, where it was stopped"
        self._say(out, Phase.STOPPED, f"{inputs.stop}; it holds until it is released")

    def _drop_the_old(self, inputs: Inputs, out: Commands) -> None:
        """What was called for so long before a restart that a look would come too late."""
        oldest = inputs.wall - self.params.resume_max_age
        hours = self.params.resume_max_age / 3600.0
        duration = "an hour" if hours == 1.0 else f"{hours:g} hours"
        why = f"the patrol was down for more than {duration}"
        old = [request for request in self.queue if request.wall < oldest]
        kept = self.queue.drop()
        self._give_up(old, why, out)
        for request in kept:
            if request not in old:
                self.queue.add(request)
        if self.mission and self.mission.called < oldest:
            self._decide(Verdict.UNVERIFIED, f"{self.mission.room.title} was not looked at to the end: {why}")
            self._end(out, "where it is")

    def _stand_down(self, inputs: Inputs, out: Commands) -> None:
        """The house was disarmed: what sensors and rounds called for is over."""
        guarding = (Origin.TRIGGER, Origin.SILENT_SENSOR, Origin.SCHEDULE)
        self._give_up(self.queue.drop(*guarding), inputs.guarded.why, out)
        mission = self.mission
        if mission and mission.origin in guarding and mission.phase is not Phase.RETURNING:
            self._decide(Verdict.UNVERIFIED, f"{mission.room.title} was not looked at to the end: {inputs.guarded.why}")
            self._enter(Phase.RETURNING, inputs)
            out.cancel = out.changed = True
