"""The alert desk: a thread writes notices to disk, the post delivers them, and neither ever stops the patrol."""

from __future__ import annotations

import dataclasses
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import rospy

from rosbot_patrol.alerts.incident import Incident
from rosbot_patrol.alerts.incident_json import load_incident, save_incident
from rosbot_patrol.alerts.mail import one_line
from rosbot_patrol.alerts.picture import LabelledBox, to_jpeg
from rosbot_patrol.alerts.postman import Delivery
from rosbot_patrol.alerts.wording import incident_notice
from rosbot_patrol.errors import AlertError
from rosbot_patrol.msg import Alert
from rosbot_patrol.patrol.commands import Notice
from rosbot_patrol.ros.owner_mail import OwnerPost
from rosbot_patrol.ros.patrol_images import PictureRing

log = logging.getLogger(__name__)

DISK_RETRY = 5.0  # [s] between attempts to write where the disk does not take it


class AlertDesk:
    """Takes notices, keeps them, delivers them.

    Args:
        post: keeps notices and delivers them.
        pictures: the camera's last pictures.
        incidents: folder of the records.
    """

    def __init__(
        self,
        post: OwnerPost,
        pictures: PictureRing,
        incidents: Path,
    ) -> None:
        self._post, self._pictures, self._incidents = post, pictures, incidents
        self._jobs: deque[tuple[Incident, Notice]] = deque()
        self._finals: deque[tuple[str, str, str, int]] = deque()
        self._memory: Callable[[], None] | None = None
        self._to_record = threading.Event()
        self._told: dict[str, Incident] = {}
        self._telling = threading.Lock()
        self._publisher = rospy.Publisher("/patrol/alerts", Alert, queue_size=10)

    def start(self) -> None:
        """Begin to work."""
        self._post.on_delivery(self._delivered)
        self._post.start()
        threading.Thread(target=_repeat, args=(self._record_next, self._to_record), name="record", daemon=True).start()

    @property
    def is_recorded(self) -> bool:
        """Whether every notice and memory taken is on disk."""
        return not self._jobs and self._memory is None

    def take(self, notice: Notice, ros_time: float) -> None:
        """Take an intruder's notice; returns at once."""
        mission, seen, pose = notice.mission, notice.seen, notice.pose
        incident = Incident(
            id=mission.id,
            wall=time.time(),
            ros_time=ros_time,
            room_id=mission.room.id,
            room_name=mission.room.name,
            phase=notice.phase.value,
            object_class=seen.label,
            probability=seen.probability,
            pictures=seen.pictures,
            verdict=mission.verdict.value if mission.verdict else "",
            reason=mission.reason,
            pose=(pose.x, pose.y, pose.yaw) if pose else None,
        )
        self._jobs.append((incident, notice))
        self._to_record.set()

    def close_incident(self, mission_id: str, verdict: str, reason: str, sightings: int) -> None:
        """Complete the record of a mission that is over; returns at once."""
        self._finals.append((mission_id, verdict, reason, sightings))
        self._to_record.set()

    def remember(self, save: Callable[[], None]) -> None:
        """Save the patrol's memory once every notice taken so far is on disk; returns at once.

        A mission is never remembered as one that gave its notice before the notice is there.
        """
        self._memory = save
        self._to_record.set()

    # -- the threads

    def _record_next(self) -> float:
        """Write one thing; returns how long to wait for the next [s]."""
        if self._jobs:
            return 0.0 if self._record(*self._jobs[0]) else DISK_RETRY
        save = self._memory
        if save is not None:
            return 0.0 if self._remember(save) else DISK_RETRY
        if self._finals:
            self._complete(*self._finals.popleft())
            return 0.0
        return 60.0

    def _remember(self, save: Callable[[], None]) -> bool:
        try:
            save()
        except OSError as err:
            log.error("the patrol's state cannot be kept: %s; trying on", err)
            return False
        if self._memory is save:
            self._memory = None
        return True

    def _delivered(self, delivery: Delivery) -> None:
        for notice_id in delivery.ids if delivery.delivered else ():
            with self._telling:  # first that it is on disk, then that it was delivered
                incident = self._told.get(notice_id) or load_incident(self._incidents, notice_id)
                if incident is not None:
                    self._publish(incident, transport=delivery.transport, location=delivery.where, text=delivery.text)

    def _record(self, incident: Incident, notice: Notice) -> bool:
        if self._post.has(incident.id):  # the program was killed after it was written
            self._jobs.popleft()
            return True
        picture, note = self._picture(notice)
        place = self._post.place
        with self._telling:
            try:
                self._post.put(incident_notice(incident, picture, picture_note=note))
            except OSError as err:
                log.error("the alert '%s' cannot be written to %s: %s; trying on", incident.sentence, place, err)
                return False
            self._told[incident.id] = incident
            self._publish(incident, transport="", location=place, text=incident.sentence)
        log.warning("ALERT: %s; the notice is on disk", incident.sentence)
        self._jobs.popleft()
        self._save(incident, picture)
        return True

    def _picture(self, notice: Notice) -> tuple[bytes | None, str]:
        if not self._pictures.is_wanted:
            return None, "none, no camera topic is set"
        raw = self._pictures.wait_for(notice.seen.stamp, 0.5)
        boxes = [
            LabelledBox(
                text=f"{one_line(b.label)} {b.probability:.2f}", xmin=b.xmin, ymin=b.ymin, xmax=b.xmax, ymax=b.ymax
            )
            for b in notice.seen.boxes
        ]
        note = "attached, the one that the boxes were found in"
        if raw is None:
            raw, boxes = self._pictures.find(notice.seen.stamp, tolerance=2.0), []
            if raw is None:
                return None, "none came from the camera"
            note = f"attached, taken {abs(raw.stamp - notice.seen.stamp):.1f} s from the detection"
        try:
            return to_jpeg(raw, boxes), note
        except AlertError as err:
            log.error("%s", err)
            return None, f"none: {err}"

    def _save(self, incident: Incident, picture: bytes | None) -> None:
        try:
            save_incident(self._incidents, incident, picture)
        except OSError as err:
            log.error("the record of incident %s cannot be written: %s", incident.id, err)

    def _complete(self, mission_id: str, verdict: str, reason: str, sightings: int) -> None:
        incident = load_incident(self._incidents, mission_id)
        if incident is not None:
            closed = dataclasses.replace(
                incident, verdict=verdict, reason=reason, sightings=sightings, closed=time.time()
            )
            self._save(closed, None)

    def _publish(self, incident: Incident, *, transport: str, location: str, text: str) -> None:
        """Tell the topic; without a transport the notice is not delivered yet."""
        message = Alert(id=incident.id, delivered=bool(transport), transport=transport, location=location, text=text)
        message.header.stamp = rospy.Time.now()
        message.room_id, message.room_name = incident.room_id, incident.room_name
        message.object_class, message.probability = incident.object_class, incident.probability
        self._publisher.publish(message)


def _repeat(work: Callable[[], float], wake: threading.Event) -> None:
    while not rospy.is_shutdown():
        try:
            pause = work()
        except Exception:  # the desk has to outlive whatever one mail does to it
            log.error("the alert desk stumbled", exc_info=True)
            pause = DISK_RETRY
        if pause > 0.0:
            wake.wait(min(pause, 60.0))
            wake.clear()
