"""narrator: prints one plain sentence for each step of the patrol; with ~exit_after_mission it ends with the mission.

Exit status: 0, or 3 if the verdict is not ~expect_verdict, 4 if ~time_limit passed, 5 if a confirmed intruder's mail
was not delivered within ~delivery_wait, 6 if the robot did not come home. With ~scenario it ends with the scenario
instead, with 7 if the scenario's expectation does not hold.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import rospy

from rosbot_patrol.alerts.records.files import REPORT
from rosbot_patrol.files import write_atomic
from rosbot_patrol.msg import Alert, EspTrigger, PatrolState
from rosbot_patrol.params import param
from rosbot_patrol.patrol.story.mission_story import AlertTelling, Narrator, Telling
from rosbot_patrol.ros.runtime.by_hand import is_launched, require_publisher
from rosbot_patrol.ros.runtime.node import load_params, run_node
from rosbot_patrol.ros.tools.narrated_scenario import ScenarioWatch

VERDICTS = ("", "confirmed", "clear", "unreachable", "unverified")


@dataclass(frozen=True, kw_only=True)
class NarratorParams:
    """Parameters of the narrator."""

    exit_after_mission: bool = param(False, doc="exit after a mission has ended and its mail is delivered")
    missions: int = param(1, lo=1, doc="number of missions to wait for")
    expect_verdict: str = param(
        "", choices=VERDICTS, doc="expected verdict of the last mission; exit status 3 for another one"
    )
    delivery_wait: float = param(30.0, unit="s", lo=0.0, doc="longest wait for the mail of a confirmed intruder")
    patience: float = param(
        5.0,
        unit="s",
        lo=0.0,
        doc="started by hand without time_limit: longest wait for the patrol to appear; 0: for ever",
    )
    time_limit: float = param(0.0, unit="s", lo=0.0, doc="time after which to exit with status 4; 0: no limit")
    summary_file: str = param("", doc="JSON file with everything that was seen; empty: none")
    scenario: str = param("", doc="file of the scenario being played; empty: none")
    simulator: str = param("simulator", doc="node name of the simulator that plays it")
    on_guard_hint: str = param("", doc="line printed when the patrol is first on guard")


class NarratorNode:
    """The node narrator: prints to standard output; times are wall time since its start."""

    def __init__(self) -> None:
        self.params = load_params(NarratorParams)
        self._lock = threading.Lock()
        self._narrator = Narrator()
        self._began = time.monotonic()
        self._ended_at: float | None = None
        self._hinted = False
        self._record = ""  # folder of the last mission's record
        self._page_at: float | None = self._began  # when to look for the console's address again
        file = self.params.scenario
        self._scenario = ScenarioWatch(file, self.params.simulator, self._tell) if file else None
        self._subscribers = [
            rospy.Subscriber("motion_trigger", EspTrigger, self._on_trigger, queue_size=100),
            rospy.Subscriber("patrol/state", PatrolState, self._on_state, queue_size=100),
            rospy.Subscriber("patrol/alerts", Alert, self._on_alert, queue_size=100),
        ]

    def run(self) -> int:
        """Print until the end; returns the exit status."""
        p = self.params
        if p.patience and not p.time_limit and not is_launched():
            require_publisher(self._subscribers[1], "patrol_robot", patience=p.patience)
        if self._scenario is not None:
            while not rospy.is_shutdown() and not all(s.get_num_connections() for s in self._subscribers[1:]):
                time.sleep(0.05)
            self._scenario.start()
        while not rospy.is_shutdown():
            time.sleep(0.1)
            self._look_for_page()
            status = self._status()
            if status is not None:
                self._finish(status)
                return status
        self._write_summary()
        return 0

    def _look_for_page(self) -> None:
        """Tell where the owner's page is, once the console runs."""
        if self._page_at is None or time.monotonic() < self._page_at:
            return
        url = rospy.get_param("console/url", "")
        self._page_at = None if url else time.monotonic() + 1.0
        if url:
            self._tell(f"the guard's page: {url}")

    def _clock(self) -> float:
        return round(time.monotonic() - self._began, 2)

    def _print(self, lines: list[str]) -> None:
        for line in lines:
            print(f"[{self._clock():6.1f} s] {line}", flush=True)

    def _tell(self, line: str) -> None:
        with self._lock:
            self._print([line])

    def _on_trigger(self, message: EspTrigger) -> None:
        if message.move:
            with self._lock:
                self._print(self._narrator.trigger(message.id))

    def _on_state(self, message: PatrolState) -> None:
        report = Telling(
            phase=message.state,
            why=message.why,
            mission=message.mission,
            room_id=message.room_id,
            room_name=message.room_name,
            last_verdict=message.last_verdict,
        )
        with self._lock:
            self._print(self._narrator.state(self._clock(), report))
            if self._narrator.on_guard_at is not None and not self._hinted:
                self._hinted = True
                self._print([self.params.on_guard_hint] if self.params.on_guard_hint else [])

    def _on_alert(self, message: Alert) -> None:
        if message.kind == Alert.VERDICT:  # the state reports it
            self._record = message.location
            return
        report = AlertTelling(
            id=message.id,
            room=f"room {message.room_id} ({message.room_name})",
            object_class=message.object_class,
            probability=message.probability,
            delivered=message.delivered,
            transport=message.transport,
            location=message.location,
        )
        with self._lock:
            self._print(self._narrator.alert(report))

    def _status(self) -> int | None:
        if self._scenario is not None:
            return self._status_of(self._scenario)
        if not self.params.exit_after_mission:
            return None
        with self._lock:
            narrator = self._narrator
            if narrator.ended < self.params.missions:
                limit = self.params.time_limit
                return 4 if limit and self._clock() > limit else None
            if self._ended_at is None:
                self._ended_at = self._clock()
            late = self._clock() - self._ended_at > self.params.delivery_wait
            if not all(map(narrator.is_complete, narrator.missions)):
                return 5 if late else None
            expected = self.params.expect_verdict
            if expected and narrator.missions[-1].verdict != expected:
                return 3
            return 0 if narrator.is_home else 6

    def _status_of(self, scenario: ScenarioWatch) -> int | None:
        with self._lock:
            narrator, limit = self._narrator, self.params.time_limit
            if limit and self._clock() > limit:
                return 4
            if not scenario.is_over(narrator):
                return None
            self._ended_at = self._ended_at or self._clock()
            if not all(map(narrator.is_complete, narrator.missions)):
                late = self._clock() - self._ended_at > self.params.delivery_wait
                return 5 if late else None
            found = scenario.failures(narrator)
            self._print(found or ["Everything came as the scenario expects."])
            return 7 if found else 0

    def _finish(self, status: int) -> None:
        with self._lock:
            self._print([_ENDS[status].format(p=self.params)] if status else [])
            if self._record:
                record = Path(self._record)
                self._print([f"What happened, with pictures: {record / REPORT}"])
                rospy.set_param("~incident", record.name)
        self._write_summary()

    def _write_summary(self) -> None:
        if self.params.summary_file:
            with self._lock:
                text = json.dumps(self._narrator.summary(), indent=1, ensure_ascii=False)
            write_atomic(Path(self.params.summary_file).expanduser().absolute(), text.encode("utf-8"))


_ENDS = {
    3: "The verdict is not the one that was expected, {p.expect_verdict}.",
    4: "The mission did not end within {p.time_limit:.0f} s.",
    6: "The robot did not come home.",
    7: "That is not what the scenario expects.",
    5: "The mail was not delivered within {p.delivery_wait:.0f} s; it stays in the outbox.",
}


def main() -> None:
    """Run the node."""
    status = 0

    def body() -> None:
        nonlocal status
        status = NarratorNode().run()

    run_node("narrator", body, by_hand=True)
    rospy.signal_shutdown("the narration is over")
    sys.stdout.flush()
    os._exit(status)
