"""patrol_robot: drives to the room of a triggered motion sensor, looks around, mails what it finds, comes home.

Matches `patrol_robot` and `patrol_robot_simulation` of the tutorial: topics /motion_trigger,
/darknet_ros/bounding_boxes, /cmd_vel, action move_base, parameters ~path_to_params, ~email_to, ~email_from.

Differs: see rosbot_patrol.patrol.mission.manager, .patrol.rooms, .patrol.spin and .alerts.mail. Additional:
- It publishes /patrol/state, /patrol/alerts and /patrol/arming.
- It has the action /patrol and the services /patrol/cancel, home, all, arm, mute and emergency_stop.
- It makes scheduled rounds, and keeps its outbox, queue and incidents in ~state_dir.
- On shutdown it stops the robot and cancels its goal.
- It makes only one action client, one tf listener and one publisher per topic.
"""

from __future__ import annotations

import dataclasses
import logging
import math
import signal
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rospy

from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.pictures.album import Sighting
from rosbot_patrol.alerts.pictures.jpeg import LabelledBox
from rosbot_patrol.alerts.pictures.ring import EvidenceParams
from rosbot_patrol.alerts.records.retention import RetentionParams
from rosbot_patrol.alerts.safe_text import one_line
from rosbot_patrol.counts import count_of
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.zones import ZONES, read_zones
from rosbot_patrol.patrol.calls.journal import Journal
from rosbot_patrol.patrol.guard.arming import Arming, ArmingRules, load_rules, read_memory
from rosbot_patrol.patrol.guard.emergency import EmergencyStop
from rosbot_patrol.patrol.guard.schedule import Schedule, load_schedule
from rosbot_patrol.patrol.house.own_files import HOUSE
from rosbot_patrol.patrol.house.rooms import Rooms
from rosbot_patrol.patrol.intruder.known_objects import FOUND_FALSE, KnownObjects
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.mission.params import NodeParams
from rosbot_patrol.patrol.mission.resume import PatrolStore
from rosbot_patrol.patrol.records.commands import Commands, OwnerMessage
from rosbot_patrol.patrol.records.inputs import Box, Frame, Inputs
from rosbot_patrol.patrol.records.mission import Phase
from rosbot_patrol.patrol.records.request import Origin, Request
from rosbot_patrol.patrol.search.room_search import RoomSearch
from rosbot_patrol.patrol.senses.params import InputParams
from rosbot_patrol.patrol.senses.senses import PatrolSenses
from rosbot_patrol.patrol.senses.sensor_rooms import SensorRooms
from rosbot_patrol.patrol.story.mission_log import MissionLog
from rosbot_patrol.ros.detector.running_network import RunningNetwork
from rosbot_patrol.ros.patrol.action import PatrolActions
from rosbot_patrol.ros.patrol.alert_desk import AlertDesk
from rosbot_patrol.ros.patrol.calls import CallDesk
from rosbot_patrol.ros.patrol.incident_keeper import IncidentKeeper, RecordParams
from rosbot_patrol.ros.patrol.inputs import PatrolInputs
from rosbot_patrol.ros.patrol.missed_calls import MissedCalls
from rosbot_patrol.ros.patrol.move_base import MoveBase
from rosbot_patrol.ros.patrol.orders import ArmingDesk, Orders, StopSwitch
from rosbot_patrol.ros.patrol.outputs import PeopleMarkers, Pulse, SeenPublisher, StatePublisher, Wheels
from rosbot_patrol.ros.patrol.pictures import PictureRing
from rosbot_patrol.ros.patrol.sensor_watch_alive import Neighbour
from rosbot_patrol.ros.patrol.settings import (
    NO_ROUNDS,
    check_files,
    files_of,
    load_flat,
    load_house,
    load_manager_params,
    load_or_say,
    own_channels,
    own_params,
)
from rosbot_patrol.ros.post.owner_post import OwnerPost, refuse_passwords
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN, Health
from rosbot_patrol.ros.runtime.file_watch import FileWatch
from rosbot_patrol.ros.runtime.node import Loop, now, private_params, run_node
from rosbot_patrol.ros.runtime.private_files import keep_private
from rosbot_patrol.ros.runtime.process import start_anew
from rosbot_patrol.ros.runtime.state_folder import claim_folder, state_folder
from rosbot_patrol.ros.runtime.transforms import Transforms

log = logging.getLogger(__name__)

HELD_MOST = 600.0  # [s] no entry delay is longer; when one is over arming says


class PatrolNode:
    """The node patrol_robot: inputs, one thread that steps the manager, outputs."""

    def __init__(self) -> None:
        tree = private_params()
        refuse_passwords(tree)
        given, mail = load_flat(NodeParams, tree), load_flat(MailParams, tree)
        folder = state_folder(given.state_dir, rospy.get_namespace())
        self._zones = folder / HOUSE / ZONES
        files = files_of(given, mail, folder)
        given_mail = mail
        self.params, mail = own_params(given, folder), own_channels(mail, folder)
        rooms, self.sensors = load_house(self.params)
        keep_private(folder)
        claim_folder(folder, rospy.get_name() + "/state_dir")
        self.health = Health()

        def check() -> None:
            check_files(own_params(given, folder), own_channels(given_mail, folder))

        self._files = FileWatch(files, check, self.health)
        evidence = load_flat(EvidenceParams, tree)
        self.pictures = PictureRing(self.params.image_topic, evidence)
        self.mission_log = MissionLog()
        self.keeper = IncidentKeeper(
            folder,
            self.pictures,
            self.health,
            evidence=evidence,
            retention=load_flat(RetentionParams, tree),
            records=load_flat(RecordParams, tree),
            on_verdict=lambda incident: self.desk.tell_verdict(incident),
        )
        self.desk = AlertDesk(OwnerPost(mail, folder, self.health), self.pictures, self.keeper, self.health)
        self.store = PatrolStore(folder / "patrol.json", str(rospy.get_param("/run_id", "")), str(rooms.source))
        self.rules = load_or_say(load_rules, self.params.arming, rooms, ArmingRules(), self.health)
        rounds, zone = load_or_say(load_schedule, self.params.schedule, rooms, NO_ROUNDS, self.health)
        self.schedule = Schedule(rounds, zone, self.store.schedule)
        params = load_manager_params(self.params, tree, rospy.get_name() + "/")
        self._views = views = RoomSearch(self.params)
        self.manager = PatrolManager(
            rooms,
            params,
            memory=self.store.memory,
            needs_camera=self.pictures.is_wanted,
            views=views,
            viewpoints=views.fallback_viewpoints,
            known=KnownObjects(self.params.known_objects, folder / FOUND_FALSE, self._say_known),
            network=RunningNetwork(self.params.network, self.params.calibrations, self.health),
        )
        how_many, how_often = count_of(len(rooms), "room"), count_of(len(rounds), "round")
        log.info("%s in %s, %s in the schedule", how_many, rooms.source, how_often)
        self._make_ends(load_flat(InputParams, tree), rooms, folder)

    def _make_ends(self, inputs: InputParams, rooms: Rooms, folder: Path) -> None:
        self._stepping = threading.Lock()
        self._loop = Loop(self.params.rate, self._step, name="patrol")
        self.inputs = self._make_inputs(inputs, rooms, Journal(folder / "calls.jsonl", self.store.taken))
        self.inputs.on_boxes = self._note_sighting
        self.missed = MissedCalls(folder / "alive", self.inputs.ask, self.inputs.room_of, self._tell_owner)
        self.neighbour = Neighbour(
            self.params.sensor_watch_after, self.params.sensor_watch_notice_after, self.health, self.inputs.listen
        )
        self.inputs.on_sensor = self.neighbour.hearing.heard
        self.markers = PeopleMarkers(inputs.map_frame)
        self._shown = ""
        self._is_over = False
        self._older: dict[str, Notice] = {}  # by incident: notices from before the restart, unknown to the memory
        self._is_signalled = False
        self._round_at = -math.inf
        self._schedule_changed = False
        self.move_base = MoveBase(inputs.map_frame)
        self._wheels, self._state, self._pulse = Wheels(), StatePublisher(self.health), Pulse()
        self._seen = SeenPublisher(inputs.map_frame)
        stop = EmergencyStop(folder / "stop.json")
        self._stop_switch = StopSwitch(stop, self.move_base, self._wheels.publisher, self.desk.write_later)
        kept = folder / "arming.json"
        memory = Arming(self.rules, read_memory(kept))
        self._arming = ArmingDesk(memory, rooms, kept, self._tell_owner, self.desk.write_later)
        self._orders = Orders(self.manager, rooms, self._stepping)
        self._actions = PatrolActions(self.manager, rooms)

    def _make_inputs(self, params: InputParams, rooms: Rooms, journal: Journal) -> PatrolInputs:
        self._lost_calls = journal.damage
        topic = self.params.eyes.depth_topic
        eyes = dataclasses.replace(self.params.eyes, depth_topic=rospy.resolve_name(topic) if topic else "")
        senses = PatrolSenses(
            params,
            eyes,
            Transforms(),
            rooms=rooms,
            alarm_classes=self.params.alarm_classes,
            health=self.health,
            zones=load_or_say(lambda path, _: read_zones(Path(path)), str(self._zones), rooms, (), self.health),
        )
        wake = self._loop.hurry
        calls = CallDesk(rooms, self.store, journal, latched_window=params.latched_window, wake=wake)
        sensor_rooms = SensorRooms(self.sensors)
        made = PatrolInputs(params, eyes, senses=senses, calls=calls, sensor_rooms=sensor_rooms, wake=wake)
        for _, room, wall in journal.left:
            made.ask(Request(room_id=room, wall=wall, note="kept over a restart"))
        return made

    def run(self) -> None:
        """Patrol until shutdown."""
        for number in (signal.SIGINT, signal.SIGTERM):
            self._note_signal(number)
        rospy.on_shutdown(self._stop)
        mission = [self.manager.mission.id] if self.manager.mission is not None else []
        running = [*mission, *(request.id for request in self.manager.queue)]
        self.keeper.start(running)
        for mission_id in running:
            self._recall_notice(mission_id)
        self.desk.start()
        if self._lost_calls:
            log.error("%s", self._lost_calls)
            self.desk.follow(Commands(words=(OwnerMessage(kind="calls lost", text=self._lost_calls),)))
        self.inputs.start()
        self.missed.start()
        self.neighbour.start()
        self._actions.start()
        self._loop.start()
        rospy.spin()

    def _recall_notice(self, mission_id: str) -> None:
        """Restore a notice that was written before a kill, if nothing else knows it."""
        notice = self.desk.find_notice(mission_id)
        if notice is None:
            return
        why = dict(notice.facts).get("Why", "somebody was seen")
        until = notice.wall + HELD_MOST if self.desk.is_held(mission_id) else None
        if self.manager.note_earlier_notice(mission_id, why, held_until=until):
            self._older[mission_id] = notice

    # -- step

    def _step(self, time_now: float) -> None:
        is_free = False
        with self._stepping:
            if not self._is_over:
                self.missed.step()
                self._actions.begin()
                self._stop_switch.step()
                inputs = self._inputs(time_now)
                commands = self.manager.step(time_now, inputs)
                self._publish(time_now, inputs, commands)
                self._actions.follow(commands.ended, commands.report)
                self._pulse.step()
                is_free = self.manager.mission is None and not self.manager.queue
        if not self._is_over and self._files.has_news() and is_free:
            start_anew("its files have changed")

    def _inputs(self, time_now: float) -> Inputs:
        guarded = self._arming.step(self.manager.calls())
        is_busy = self.manager.mission is not None
        known = self.inputs.take(time_now, guarded, self._stop_switch.why, is_busy=is_busy)
        return dataclasses.replace(
            known,
            frames=tuple(self._about(frame) for frame in known.frames),
            requests=known.requests + self._rounds(time_now, known),
            link=self.move_base.link(),
            camera_at=self.pictures.seen_at,
            camera_changed_at=self.pictures.changed_at,
        )

    def _about(self, frame: Frame) -> Frame:
        """A frame with what its picture tells besides the boxes."""
        is_same = self.pictures.is_same(frame.stamp)
        return dataclasses.replace(frame, is_same=is_same, is_dark=self.pictures.is_dark)

    def _rounds(self, time_now: float, known: Inputs) -> tuple[Request, ...]:
        """Rooms of the due rounds; checked once a second."""
        if 0.0 <= time.monotonic() - self._round_at < 1.0:
            return ()
        self._round_at = time.monotonic()
        due = self.schedule.step(time_now, known.wall, known.guarded.mode)
        self._schedule_changed |= self.schedule.changed
        return tuple(
            Request(room_id=room, origin=Origin.SCHEDULE, note=f"round '{entry.name}'", wall=known.wall)
            for entry in due
            for room in entry.rooms
        )

    def _say_known(self, problem: str) -> None:
        """Report the file of known objects that the console writes."""
        if problem:
            log.error("%s; the objects of its last good state stay known", problem)
        self.health.set("known objects", WARN if problem else OK, problem or "the file is well")

    def _tell_owner(self, word: OwnerMessage) -> None:
        self.desk.follow(Commands(words=(word,)))

    def _note_sighting(self, stamp: float, boxes: Sequence[Box]) -> None:
        alarms = [box for box in boxes if box.label in self.params.alarm_classes]
        if alarms and self.manager.mission is not None:
            drawn = [
                LabelledBox(
                    text=f"{one_line(b.label)} {b.probability:.2f}", xmin=b.xmin, ymin=b.ymin, xmax=b.xmax, ymax=b.ymax
                )
                for b in alarms
            ]
            self.keeper.note(Sighting(stamp=stamp, probability=max(b.probability for b in alarms), boxes=drawn))

    # -- publish

    def _publish(self, time_now: float, inputs: Inputs, commands: Commands) -> None:
        if commands.cancel:
            self.move_base.cancel()
        if commands.goal is not None:
            self.move_base.send(commands.goal)
        self._wheels.turn(commands.speed)
        if commands.report is not None:
            self._state.publish(time_now, commands.report, self.manager.mission)
        if commands.pictures is not None:
            self.pictures.keep(commands.pictures)
        for alarm in commands.alarms:
            self.desk.take(alarm, time_now)
        commands.words += self.neighbour.step()
        self.desk.follow(commands)
        self._record(time_now, commands, inputs.pose)
        self._show_people(time_now, commands)
        self._seen.step(time_now, lambda: self._views.seen_floor() if self.manager.mission is not None else None)
        if self.manager.mission is not None or self.keeper.needs_pictures:
            self.pictures.start()
        elif self.desk.is_recorded:
            self.pictures.stop()
        self.inputs.calls.note_served(self.manager.served())
        changed = commands.changed or self._schedule_changed
        self._schedule_changed = False
        self._save(self.inputs.calls.has_latched() or changed)

    def _record(self, time_now: float, commands: Commands, pose: Pose2D | None = None) -> None:
        mission = self.manager.mission
        entries = self.mission_log.step(
            now=time_now,
            wall=time.time(),
            mission=mission,
            commands=commands,
            pose=pose,
            heard=self.inputs.take_heard(),
        )
        self.keeper.put(entries)
        if mission is not None and mission.id in self._older:
            self.desk.recall(mission.id, self._older.pop(mission.id))
        self.keeper.look(mission.id if mission is not None and mission.phase is Phase.LOOKING else "")

    def _show_people(self, time_now: float, commands: Commands) -> None:
        mission = self.manager.mission
        if mission is not None and mission.id != self._shown:
            self._shown = mission.id
            self.markers.clear()
        if commands.people:
            self.markers.show(commands.people, time_now, mission.room.title if mission else "")

    def _save(self, changed: bool) -> None:
        if not changed:
            return
        memory, served = self.manager.snapshot(), self.manager.served()
        taken, schedule = self.inputs.calls.taken, self.schedule.snapshot()

        def save() -> None:
            self.store.save(memory, taken=taken, schedule=schedule)
            self.inputs.calls.note_saved(served, taken)

        self.desk.remember(save)

    def _note_signal(self, number: int) -> None:
        rospys = signal.getsignal(number)

        def note(received: int, frame: Any) -> None:
            self._is_signalled = True
            if callable(rospys):
                rospys(received, frame)

        signal.signal(number, note)

    def _stop(self) -> None:
        """Stop the robot: cancel the goal, stop the wheels.

        A signal (Ctrl-C, the end of the launch) also cancels missions, unless `keep_calls_at_end`. After any other end
        (`rosnode kill`) the respawned node continues them.
        """
        with self._stepping:
            self._is_over = True
            if self._is_signalled and not self.params.keep_calls_at_end:
                self._record(now(), self.manager.abandon("the patrol was ended"))
                self.missed.end()
            self.move_base.cancel()
            self._wheels.stop()
            self._save(changed=True)
        self.keeper.finish()
        deadline = time.monotonic() + 2.0
        while not (self.desk.is_recorded and self.keeper.is_written) and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(0.1)  # time for the two messages to leave


def main() -> None:
    """Run the node."""
    run_node("patrol_robot", lambda: PatrolNode().run())
