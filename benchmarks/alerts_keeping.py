"""Cost of state and incident keeping in the patrol's process: its own objects, fed with a minute's patrol at full
rates.

A minute of a patrol has 20 s of driving, 30 s of looking and 10 s of return. There are 25 steps and 10 pictures of
640 x 480 per second, sensor triggers, and a person in every second patrol. It runs as fast as possible. The result is
the total CPU time, with writing, encoding, map and report, as a share of the minute. The patrol's earlier work
(receiving pictures) is not included.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from rosbot_patrol.alerts.pictures.album import Sighting
from rosbot_patrol.alerts.pictures.jpeg import LabelledBox, RawPicture
from rosbot_patrol.alerts.pictures.map import crop_map
from rosbot_patrol.alerts.pictures.ring import EvidenceParams, EvidenceRing
from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.patrol.house.rooms import Room
from rosbot_patrol.patrol.records.commands import Commands, IntruderAlarm, Report
from rosbot_patrol.patrol.records.findings import Confirmation
from rosbot_patrol.patrol.records.mission import Mission, Phase, Verdict
from rosbot_patrol.patrol.story.mission_log import MissionLog
from rosbot_patrol.ros.patrol.incident_keeper import IncidentKeeper

ROOT = Path(__file__).resolve().parent.parent
SECONDS, STEPS, PICTURES = 60, 25, 10
WALL = 1_790_000_000.0


class _Pictures:
    def __init__(self) -> None:
        self.ring = EvidenceRing(seconds=6.0, rate=5.0, max_bytes=40e6)

    def snapshot(self) -> EvidenceRing:
        return self.ring.snapshot()


class _Health:
    def set(self, *_: object) -> None:
        pass


def measure() -> dict[str, float]:
    noise = np.random.default_rng(1).integers(60, 200, (8, 480, 640, 3), dtype=np.uint8)
    noise[:, 40:440, 80:560] = 128  # about as much detail as a room
    frames = [picture.tobytes() for picture in noise]
    shares: dict[bool, list[float]] = {False: [], True: []}
    with tempfile.TemporaryDirectory() as folder:
        keeper = IncidentKeeper(Path(folder), _Pictures(), _Health(), evidence=EvidenceParams())  # type: ignore[arg-type]
        keeper._map = crop_map(read_map(ROOT / "maps" / "rosbot_map.yaml"))
        keeper.step()
        for number in range(8):
            shares[number % 2 == 1].append(patrol(keeper, number, frames, is_seen=number % 2 == 1))
    empty, seen = (100 * statistics.median(shares[key]) for key in (False, True))
    print(
        f"keeping state and incidents: {empty:.1f} % of a core in a patrol without anybody, {seen:.1f} % with somebody"
    )
    return {"keeping_cpu_pct": round(empty, 2), "keeping_cpu_seen_pct": round(seen, 2)}


def patrol(keeper: IncidentKeeper, number: int, frames: list[bytes], *, is_seen: bool) -> float:
    """Share of a core that a patrol takes."""
    chronicle, start = MissionLog(), 1000.0 * (number + 1)
    mission = Mission(id=f"m{number}", room=Room(id=3, name="hall", pose=Pose2D(4.0, 0.0, 0.0)), wall=WALL + start)
    spent = 0.0
    for tick in range(SECONDS * STEPS):
        seconds = tick / STEPS
        now = start + seconds
        phase = Phase.DRIVING if seconds < 20 else Phase.LOOKING if seconds < 50 else Phase.RETURNING
        report = (
            Report(phase=phase, why=f"{phase.value}, {seconds:.0f} s", mission=mission.id) if tick % 50 == 0 else None
        )
        heard = [Event(wall=WALL + now, kind="sensor", text="motion sensor 3 sees motion")] if tick % 125 == 0 else []
        alarms: tuple[IntruderAlarm, ...] = ()
        if is_seen and tick == 25 * STEPS:
            mission.verdict, mission.reason = Verdict.CONFIRMED, "person seen"
            seen = Confirmation(label="person", probability=0.9, stamp=now, boxes=(), pictures=3)
            alarms = (IntruderAlarm(mission=mission, seen=seen, phase=phase, pose=mission.room.pose),)
        mission.phase = phase
        is_last = tick == SECONDS * STEPS - 1
        if is_last and mission.verdict is None:
            mission.verdict, mission.reason = Verdict.CLEAR, "nobody seen"
        commands = Commands(report=report, alarms=alarms, ended=(mission,) if is_last else ())
        picture = None
        if tick * PICTURES // STEPS != (tick - 1) * PICTURES // STEPS:
            data = frames[tick % len(frames)]
            picture = RawPicture(stamp=now, width=640, height=480, encoding="rgb8", step=1920, data=data)
        began = time.process_time()
        if picture is not None:
            keeper._pictures.ring.add(picture)  # type: ignore[attr-defined]
        if is_seen and picture is not None and 25 <= seconds < 35:
            box = LabelledBox(text="person 0.90", xmin=200, ymin=100, xmax=320, ymax=420)
            keeper.note(Sighting(stamp=now, probability=0.9, boxes=[box]))
        pose = Pose2D(0.2 * min(seconds, 20.0), 0.0, 0.0)
        entries = chronicle.step(now=now, wall=WALL + now, mission=mission, commands=commands, pose=pose, heard=heard)
        keeper.put(entries)
        keeper.look(mission.id if phase is Phase.LOOKING else "")
        if alarms:
            keeper.see(mission.id, now)
        if entries or tick % (STEPS // 2) == 0:
            keeper.step()
        spent += time.process_time() - began
    return spent / SECONDS
