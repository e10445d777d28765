"""What the camera sees on a mission: who is confirmed, told and kept in view."""

from __future__ import annotations

import dataclasses
import logging

from rosbot_patrol.patrol.house.regions import NOBODYS
from rosbot_patrol.patrol.house.rooms import Room
from rosbot_patrol.patrol.mission.mission_run import Conduct
from rosbot_patrol.patrol.records.commands import Commands, Notice, Release
from rosbot_patrol.patrol.records.findings import Confirmation, Person
from rosbot_patrol.patrol.records.inputs import Frame, Inputs
from rosbot_patrol.patrol.records.mission import Mission, Verdict
from rosbot_patrol.patrol.story import status_text as saying

log = logging.getLogger(__name__)


class Lookout(Conduct):
    """A `Conduct` that minds what the detector sees. Arguments as of Conduct."""

    def _watch_frames(self, inputs: Inputs, out: Commands) -> None:
        mission = self.mission
        assert mission is not None
        if inputs.house is not None:
            self._judge.floor = inputs.house.floor
        self._close_ups.add_pets(self._views.harmless())
        for given in inputs.frames:
            frame = self._leave_out_close_ups(given)
            for seen in self._watch.add(self._clock.time, frame):
                self._suspects.told(seen.measured)
                self._note(mission, seen, inputs, out)
            for seen in self._weigh(frame):
                self._note(mission, seen, inputs, out)
            self._point_at(frame, inputs)
        self._views.suspect(self._suspects.doubtful())
        self._views.step_back(self._close_ups.doubtful)

    def _leave_out_close_ups(self, frame: Frame) -> Frame:
        """What is too near to be told from a pet proves nothing, but the robot stops for it."""
        if not frame.counts or frame.stamp is None:
            return frame
        boxes, is_left = self._close_ups.sort(frame.stamp, frame.boxes, frame.eye)
        if is_left:
            self._watch.glimpse(self._clock.time)
        return dataclasses.replace(frame, boxes=boxes)

    def _weigh(self, frame: Frame) -> tuple[Confirmation, ...]:
        """Weak sights are gathered by place."""
        if not frame.counts or frame.stamp is None or frame.eye is None:
            return ()
        return self._suspects.add(frame.stamp, frame.eye.pose, self._watch.plausible(frame), frame.picture)

    def _note(self, mission: Mission, seen: Confirmation, inputs: Inputs, out: Commands) -> None:
        """Somebody was confirmed."""
        mission.sightings += 1
        if mission.best is None or seen.probability > mission.best.probability:
            mission.best = seen
        person, is_new = self._people.note(self._clock.time, seen.measured)
        room, is_outside = self._room_at(person, inputs)
        person.label, person.room = seen.label, room.title if room else ""
        mission.people = self._people.places
        if mission.place is None and person.number == 1:  # it stays what the sentence and the mail say
            mission.place, mission.place_room, mission.is_outside = mission.people[0], room, is_outside
        out.people = tuple(self._people.met)
        said = saying.sighting(mission, seen, room, is_outside=is_outside)
        if mission.verdict is not Verdict.CONFIRMED:
            self._decide(Verdict.CONFIRMED, said)
        if is_new:
            notice = self._notice(mission, inputs, seen, person.number)
            if person.number > 1:
                log.warning("a second incident, %s: %s", notice.mission.id, said)
                notice.mission.place_room, notice.mission.is_outside = room, is_outside
                notice.mission.reason = said
            mission.notified = out.changed = True
            out.notices += (notice,)

    def _room_at(self, person: Person, inputs: Inputs) -> tuple[Room | None, bool]:
        """The room in which a person is, and whether they are known to be in none."""
        if inputs.house is None or person.x is None or person.y is None:
            return None, False
        found = inputs.house.room_at(person.x, person.y)
        return self.rooms.find(found), found == NOBODYS

    def _notice(self, mission: Mission, inputs: Inputs, seen: Confirmation, number: int) -> Notice:
        copy = dataclasses.replace(mission, people=list(mission.people))
        if number > 1:
            copy.id, copy.place = f"{mission.id}-{number}", mission.people[number - 1]
        until = inputs.guarded.holds_until
        if until is not None:
            self.held[copy.id] = until
        return Notice(mission=copy, seen=seen, phase=mission.phase, pose=inputs.pose, is_held=until is not None)

    # -- the camera is kept on a person

    def _point_at(self, frame: Frame, inputs: Inputs) -> None:
        boxes = self._watch.plausible(frame)
        if not boxes or (self._watch.lately(self._clock.time) < 2 and not self._track.is_on):
            return  # a single picture stops no drive
        if frame.eye is None or inputs.pose is None or inputs.yaw is None:
            return
        column = (boxes[0].xmin + boxes[0].xmax) / 2.0
        in_odom = frame.eye.pose.yaw - inputs.pose.yaw + inputs.yaw  # odom goes on where the map's part does not
        self._track.see(self._clock.time, frame.eye.bearing(column), in_odom)

    def _keep_in_view(self, inputs: Inputs, out: Commands) -> bool:
        """Turn towards whom the camera has in view; what the robot was about waits."""
        lost = " and ".join(["its pose in the map"] * (inputs.pose is None) + ["its heading"] * (inputs.yaw is None))
        if lost and self._track.is_on:
            log.warning("the camera no longer follows whom it sees: the robot does not know %s", lost)
            self._track.release(self._clock.time)
        speed = self._track.step(self._clock.time, inputs.yaw)
        mission, was_tracking = self.mission, self._is_tracking
        assert mission is not None
        self._is_tracking = speed is not None
        if speed is None:
            return False
        if not was_tracking:
            out.cancel |= self._interrupt()
        if self._look is not None and not self._look.drives:
            self._look.step(self._clock.time, inputs, candidate=False, held=True)
        near = inputs.clearance is not None and inputs.clearance < self.params.spin.spin_clearance
        out.speed = 0.0 if near else speed
        self._say(out, mission.phase, f"keeping the camera on somebody, {saying.phase_text(mission)}")
        return True

    def _interrupt(self) -> bool:
        """Leave off driving; whether there is a goal to give up."""
        if self._look is not None:
            self._look.pause()
            return self._look.drives
        if self._trip is not None:
            self._trip.pause()
        return self._trip is not None

    # -- notices that waited

    def _release(self, inputs: Inputs, out: Commands) -> None:
        """Notices whose entry delay is over, or that were disarmed in time."""
        for mission, until in list(self.held.items()):
            disarmed = inputs.guarded.mode == "disarmed"
            if disarmed or inputs.wall >= until or inputs.guarded.holds_until is None:
                del self.held[mission]
                why = "disarmed within the entry delay" if disarmed else "the entry delay is over"
                out.releases += (Release(mission=mission, is_dropped=disarmed, why=why),)
                out.changed = True
