"""The alert desk: a thread writes notices to the disk, the post delivers them, and the patrol waits for neither."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial

import rospy

from rosbot_patrol.alerts.dispatch.delivery import Delivery
from rosbot_patrol.alerts.outbox.damaged_notices import replacement
from rosbot_patrol.alerts.outbox.delayed_notices import DelayedNotices
from rosbot_patrol.alerts.outbox.incident_notices import incident_notice, verdict_notice
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.pictures.jpeg import LabelledBox, to_jpeg
from rosbot_patrol.alerts.records.files import FOLDER, NewFile
from rosbot_patrol.alerts.records.incident import Event, Incident
from rosbot_patrol.alerts.records.store import recall_incident
from rosbot_patrol.alerts.safe_text import one_line, token
from rosbot_patrol.errors import AlertError
from rosbot_patrol.msg import Alert
from rosbot_patrol.patrol.calls.ignored_log import IgnoredLog
from rosbot_patrol.patrol.records.commands import Commands, Ignored, IntruderAlarm, OwnerMessage, Release
from rosbot_patrol.patrol.story.mission_log import Entry, person_room
from rosbot_patrol.ros.patrol.incident_keeper import IncidentKeeper
from rosbot_patrol.ros.patrol.pictures import PictureRing
from rosbot_patrol.ros.post.owner_post import OwnerPost
from rosbot_patrol.ros.runtime.diagnostics import ERROR, OK, Health
from rosbot_patrol.ros.runtime.node import Worker

log = logging.getLogger(__name__)

DISK_RETRY = 5.0  # time between attempts while the disk refuses something [s]
RECORD_WAIT = 2.0  # longest wait of the patrol's memory for the records [s]


class AlertDesk:
    """Store the patrol's notices and have them delivered.

    Args:
        post: stores and delivers notices.
        pictures: the camera's last pictures.
        keeper: keeper of the records.
        health: receives the desk's health.
    """

    def __init__(
        self,
        post: OwnerPost,
        pictures: PictureRing,
        keeper: IncidentKeeper,
        health: Health,
    ) -> None:
        self._post, self._pictures, self._keeper, self._health = post, pictures, keeper, health
        self._delayed = DelayedNotices(keeper.state_dir / "held")
        self._ignored = IgnoredLog(keeper.state_dir / "ignored.jsonl")
        self._jobs: deque[Callable[[], None]] = deque()
        self._unwritten: list[Callable[[], None]] = []
        self._listing = threading.Lock()
        self._retry_at = 0.0
        self._memory: Callable[[], None] | None = None
        self._memory_due = 0.0
        self._to_record = threading.Event()
        self._incidents: dict[str, Incident] = {}
        self._telling = threading.Lock()
        self._publisher = rospy.Publisher("patrol/alerts", Alert, queue_size=10)

    def start(self) -> None:
        """Start the threads."""
        self._post.on_delivery(self._delivered)
        self._post.start()
        Worker(partial(_repeat, self._record_next, self._to_record), name="record").start()

    @property
    def is_recorded(self) -> bool:
        """Whether every accepted notice and memory is on the disk."""
        return not self._jobs and self._memory is None

    def is_held(self, incident: str) -> bool:
        """Whether the notice of this incident is delayed by the entry delay."""
        try:
            return self._delayed.has(token(incident))
        except OSError as err:
            log.error("the notice about %s cannot be looked for: %s", incident, err)
            return False

    def find_notice(self, incident: str) -> Notice | None:
        """The notice of an incident from before the restart, None if there is none."""
        try:
            return self._delayed.get(token(incident)) or self._post.find(token(incident))
        except (OSError, ValueError) as err:
            log.error("the notice about %s cannot be read: %s", incident, err)
            return None

    def write_later(self, write: Callable[[], None]) -> None:
        """Call `write` repeatedly until it raises no OSError; returns at once."""
        with self._listing:
            if write not in self._unwritten:
                self._unwritten.append(write)
        self._to_record.set()

    def recall(self, incident: str, notice: Notice) -> None:
        """Complete the record of a mission with its notice, which survived the restart without the patrol's memory."""
        event = Event(wall=notice.wall, kind="seen", text="somebody was seen, and the program was killed right after")
        self._keeper.put([Entry(incident=incident, changes={"confirmed": notice.wall}, events=(event,))])
        if notice.picture is not None:
            caption = "sent with the notice"
            file = NewFile(name="seen.jpg", role="detection", data=notice.picture, stamp=notice.wall, caption=caption)
            self._keeper.put_picture(incident, file)

    def take(self, alarm: IntruderAlarm, ros_time: float) -> None:
        """Accept an intruder alarm; returns at once."""
        mission, seen, pose = alarm.mission, alarm.seen, alarm.pose
        incident = Incident(
            id=mission.id,
            wall=time.time(),
            ros_time=ros_time,
            room_id=mission.room.id,
            room_name=mission.room.name,
            origin=mission.origin.value,
            phase=alarm.phase.value,
            object_class=seen.label,
            probability=seen.probability,
            pictures=seen.pictures,
            verdict=mission.verdict.value if mission.verdict else "",
            reason=mission.reason,
            pose=(pose.x, pose.y, pose.yaw) if pose else None,
            person=mission.place,
            **person_room(mission),
        )
        self._jobs.append(lambda: self._record(incident, alarm))
        self._keeper.see(incident.id, seen.stamp)
        self._to_record.set()

    def follow(self, commands: Commands) -> None:
        """Process a step's other outputs for the owner: delayed notices, messages, calls that start no mission."""
        jobs = [partial(self._release, release) for release in commands.releases]
        jobs += [partial(self._tell, word, time.time()) for word in commands.words]
        jobs += [partial(self._note_ignored, commands.ignored)] * bool(commands.ignored)
        if jobs:
            self._jobs.extend(jobs)
            self._to_record.set()

    def remember(self, save: Callable[[], None]) -> None:
        """Save the patrol's memory once every accepted notice is on the disk; returns at once.

        So the memory never says that a mission gave its notice before that is written. It also never says that a
        mission is over before the record does, unless the disk refuses records.
        """
        if self._memory is None:
            self._memory_due = time.monotonic() + RECORD_WAIT
        self._memory = save
        self._to_record.set()

    # -- the threads

    def _record_next(self) -> float:
        """Write one item; returns the pause until the next [s]."""
        if self._jobs:
            job = self._jobs[0]
            try:
                job()
            except Exception:  # this job must wait for the others
                self._jobs.rotate(-1)
                raise
            self._jobs.popleft()
            return 0.0
        self._write_again()
        self._keeper.give_way(self._post.is_disk_full)
        save = self._memory
        if save is None:
            return DISK_RETRY if self._unwritten or not self._post.is_written else 60.0
        if self._unwritten or not self._post.is_written:
            return 1.0
        if not self._keeper.is_written and time.monotonic() < self._memory_due:
            return 0.02
        return 0.0 if self._remember(save) else DISK_RETRY

    def _write_again(self) -> None:
        if time.monotonic() < self._retry_at:
            return
        with self._listing:
            waiting = list(self._unwritten)
        for write in waiting:
            with suppress(OSError):  # the failure was reported when it occurred
                write()
                with self._listing:
                    self._unwritten.remove(write)
        self._retry_at = time.monotonic() + DISK_RETRY

    def _remember(self, save: Callable[[], None]) -> bool:
        try:
            save()
        except OSError as err:
            log.error("the patrol's state cannot be kept: %s; trying on", err)
            self._health.set("memory", ERROR, f"the patrol's state cannot be kept: {err}")
            return False
        self._health.set("memory", OK, "the patrol's state is kept")
        if self._memory is save:
            self._memory = None
        return True

    def _delivered(self, delivery: Delivery) -> None:
        for notice_id in delivery.ids if delivery.delivered else ():
            with self._telling:  # so that "on disk" is published before "delivered"
                incident = self._incidents.get(notice_id) or recall_incident(self._keeper.state_dir, notice_id)
                if incident is not None:
                    self._publish(incident, transport=delivery.transport, location=delivery.where, text=delivery.text)

    def _record(self, incident: Incident, alarm: IntruderAlarm) -> None:
        """Write a notice to the disk; if the disk refuses, keep it in the post's memory, which sends it from there."""
        if self._post.has(incident.id) or self.is_held(incident.id):  # written before a kill
            return
        picture, note = self._picture(alarm)
        place = str(self._delayed.folder) if alarm.is_held else self._post.place
        with self._telling:
            self._incidents[incident.id] = incident
            is_on_disk = (self._hold if alarm.is_held else self._post.put)(
                incident_notice(incident, picture, picture_note=note)
            )
            self._publish(incident, transport="", location=place, text=incident.sentence)
        where = "is on disk" if is_on_disk else "is in memory only, as the disk does not take it"
        waits = " and waits for the entry delay" if alarm.is_held else ""
        log.warning("ALERT: %s; the notice %s%s", incident.sentence, where, waits)
        if picture is not None:
            caption = "sent with the notice"
            file = NewFile(name="seen.jpg", role="detection", data=picture, stamp=alarm.seen.stamp, caption=caption)
            self._keeper.put_picture(incident.id, file)

    def _hold(self, notice: Notice) -> bool:
        """Store a notice for the entry delay; returns whether it is on the disk."""
        try:
            self._delayed.put(notice)
        except OSError as err:
            log.error("the notice %s cannot be written to %s: %s; trying on", notice.id, self._delayed.folder, err)
            self.write_later(self._delayed.save)
            return False
        return True

    def _release(self, release: Release) -> None:
        """Send a delayed notice, or drop it."""
        notice_id = token(release.mission)
        try:
            notice = self._delayed.get(notice_id)
        except (OSError, ValueError) as err:
            log.error("the notice about %s that waited cannot be used: %s", release.mission, err)
            notice = replacement(self._keeper.state_dir, notice_id, time.time())
        if notice is not None and not release.is_dropped:
            self._post.put(notice)
        try:
            self._delayed.remove(notice_id)
        except OSError as err:
            log.error("the notice about %s that waited cannot be removed: %s; trying on", release.mission, err)
            self.write_later(partial(self._delayed.remove, notice_id))
        text = f"the notice is {'dropped' if release.is_dropped else 'sent'}: {release.why}"
        log.warning("%s (%s)", text, release.mission)
        event = Event(wall=time.time(), kind="notice", text=text)
        self._keeper.put([Entry(incident=release.mission, events=(event,))])

    def _tell(self, word: OwnerMessage, wall: float) -> None:
        """Send the owner a message about something other than an intruder."""
        self._post.put(
            Notice(
                id=token(f"{word.kind}-{wall:.3f}"),
                wall=wall,
                kind="fault",
                subject=f"rosbot patrol: {word.kind}{' again well' if word.is_over else ''}",
                text=f"{word.text[:1].upper()}{word.text[1:]}.",
            )
        )

    def _note_ignored(self, calls: tuple[Ignored, ...]) -> None:
        try:
            self._ignored.add(calls)
        except OSError as err:
            log.error("calls that start no mission cannot be written down: %s", err)

    def _picture(self, alarm: IntruderAlarm) -> tuple[bytes | None, str]:
        if not self._pictures.is_wanted:
            return None, "none, no camera topic is set"
        raw = self._pictures.wait_for(alarm.seen.stamp, 0.5)
        boxes = [
            LabelledBox(
                text=f"{one_line(b.label)} {b.probability:.2f}", xmin=b.xmin, ymin=b.ymin, xmax=b.xmax, ymax=b.ymax
            )
            for b in alarm.seen.boxes
        ]
        note = "attached, the one that the boxes were found in"
        if raw is None:
            raw, boxes = self._pictures.find(alarm.seen.stamp, tolerance=2.0), []
            if raw is None:
                return None, "none came from the camera"
            note = f"attached, taken {abs(raw.stamp - alarm.seen.stamp):.1f} s from the detection"
        try:
            return to_jpeg(raw, boxes), note
        except AlertError as err:
            log.error("%s", err)
            return None, f"none: {err}"

    def tell_verdict(self, incident: Incident) -> None:
        """Publish the verdict of a mission whose record is on the disk."""
        place = str(self._keeper.state_dir / FOLDER / incident.id)
        self._publish(incident, transport="", location=place, text=incident.sentence, kind=Alert.VERDICT)
        if incident.verdict in self._post.notify_verdicts:
            self._post.keep(verdict_notice(incident))

    def _publish(self, incident: Incident, *, transport: str, location: str, text: str, kind: str = "") -> None:
        """Publish an alert; without a transport its notice is not delivered yet."""
        message = Alert(id=incident.id, delivered=bool(transport), transport=transport, location=location, text=text)
        message.header.stamp = rospy.Time.now()
        message.room_id, message.room_name = incident.room_id, incident.room_name
        message.object_class, message.probability = incident.object_class, incident.probability
        message.kind = kind or (Alert.DELIVERED if transport else Alert.SEEN)
        message.verdict = incident.verdict
        message.share_seen = -1.0 if incident.share_seen is None else incident.share_seen
        self._publisher.publish(message)


def _repeat(work: Callable[[], float], wake: threading.Event) -> None:
    while not rospy.is_shutdown():
        try:
            pause = work()
        except Exception:  # a defect triggered by one notice must not end the desk
            log.error("the alert desk stumbled", exc_info=True)
            pause = DISK_RETRY
        if pause > 0.0:
            wake.wait(min(pause, 60.0))
            wake.clear()
