"""Runs one patrol of a campaign in the real house, and records the result."""

from __future__ import annotations

import json
import logging
import math
import os
import time
from pathlib import Path
from typing import Any

from rosbot_patrol.alerts.records.database import NAME
from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.campaign.crash_ledger import KeptMail
from rosbot_patrol.campaign.floor import Floor
from rosbot_patrol.campaign.houses import load_house
from rosbot_patrol.campaign.plan import CONFIRMED, WITHIN, Patrol, patrol_from_plain, scenario_text
from rosbot_patrol.campaign.record import PLAN, RESULT, Result
from rosbot_patrol.campaign.share import true_share
from rosbot_patrol.campaign.truth import Presence, place_error, presence, touches
from rosbot_patrol.errors import StoreError
from rosbot_patrol.files import write_atomic
from rosbot_patrol.msg import Alert, PatrolState
from rosbot_patrol.ros.campaign.house import House, HouseError, Master
from rosbot_patrol.ros.campaign.mail_sink import kept_mails
from rosbot_patrol.ros.campaign.watch import CampaignWatch, Recording

READY = 120.0  # longest wait for the house to be on guard [s]
MAIL = 20.0  # longest wait for a mail after the mission [s]
HOME = 0.35  # distance from the start at which the robot is home [m]
NEXT = 1.0  # simulated time after a mission in which a waiting one has begun [s]

Times = dict[str, float]

log = logging.getLogger(__name__)


def play(folder: Path, root: Path, limit: float) -> Result:
    """Run the patrol planned in a folder.

    Args:
        folder: with the plan; receives the result, mails, state and log.
        root: of the package.
        limit: for all of it [s] of real time.
    """
    patrol = patrol_from_plain(json.loads((folder / PLAN).read_text(encoding="utf-8")))
    file = folder / "scenario.yaml"
    write_atomic(file, scenario_text(patrol).encode())
    began = time.monotonic()
    os.environ["ROS_HOME"] = os.environ["ROS_LOG_DIR"] = str(folder / "ros")
    master = Master(folder / "roscore.log")
    watch = CampaignWatch()
    arguments: dict[str, Any] = {
        "scenario": file,
        "watched": "true",
        "rate": 0,
        "teleop": "false",
        "house": patrol.house,
    }
    house = House(folder, "rosbot_patrol", "scenario.launch", seed=patrol.scenario["seed"], **arguments)
    problem = ""
    try:
        house.start()
        house.wait_ready(min(READY, limit))
        _wait_for_the_end(house, watch, patrol, began + limit)
    except HouseError as err:
        problem = str(err).splitlines()[0]
    finally:
        mails = len(_notices(house))
        contacts = [other for kind, other in house.contacts if kind != "floor"]
        house.stop()
        watch.stop()
        master.stop()
    wall = time.monotonic() - began
    found: dict[str, Any] = {"problem": problem, "mails": mails, "contacts": contacts, "wall_s": wall}
    result = evaluate(patrol, watch.heard, root, folder / "state", **found)
    write_atomic(folder / RESULT, result.to_json().encode())
    return result


def _wait_for_the_end(house: House, watch: CampaignWatch, patrol: Patrol, until: float) -> None:
    """Wait until the mission to the room is over and its mail has arrived."""

    def is_over() -> bool:
        end = _mission(watch.heard, patrol.room)[1]
        return end is not None and watch.now > watch.heard.states[end].time + NEXT

    house.wait(lambda: is_over() or watch.now > WITHIN, until - time.monotonic(), "the end of the patrol")
    if not is_over():
        raise HouseError(f"after {WITHIN:.0f} s of simulated time the patrol has not ended")
    deadline = time.monotonic() + MAIL
    last = house.state.last_verdict if house.state else ""
    while last == CONFIRMED and not _notices(house) and time.monotonic() < deadline:
        time.sleep(0.1)


def _notices(house: House) -> list[KeptMail]:
    """Mails about incidents, without those about silent motion sensors."""
    return kept_mails((house.maildir / "new",))


def _mission(heard: Recording, room: int) -> tuple[int | None, int | None]:
    """Indices of the states where the first mission to a room begins, and where the rest after it begins."""
    begin = next((i for i, s in enumerate(heard.states) if s.message.mission and s.message.room_id == room), None)
    if begin is None:
        return None, None
    mission = heard.states[begin].message.mission
    rest = (i for i, s in enumerate(heard.states[begin:], begin) if s.message.mission != mission)
    return begin, next(rest, None)


def evaluate(
    patrol: Patrol,
    heard: Recording,
    root: Path,
    state_dir: Path,
    *,
    problem: str,
    mails: int,
    contacts: list[str],
    wall_s: float,
) -> Result:
    """Compare a recording, and the guard's own records, with ground truth."""
    found = load_house(patrol.house, root)
    floor = Floor(found.bodies, found.rooms)
    begin, end = _mission(heard, patrol.room)
    verdict, reason = "", ""
    if begin is not None and end is not None:
        verdict, reason = heard.states[end].message.last_verdict, heard.states[end].message.why
    times, decided = _times(heard, patrol, begin, end)
    triggered = next((t for t, room in heard.triggers if room == patrol.room), 0.0)
    robot, tracks = heard.robot_track(), heard.actor_tracks()
    last = decided if decided is not None else (robot.times[-1] if robot.times else 0.0)
    there = presence(floor, patrol.room, patrol.people, tracks, robot, triggered, last)
    times |= _from_view(there, heard)
    kept = _kept(state_dir, None if begin is None else heard.states[begin].message.mission)
    person = kept.person if kept is not None else None
    looked = times.get("looked")
    went_on = end is None or any(s.message.mission for s in heard.states[end:])  # called again before it was home
    home = math.dist(robot.poses[-1][:2], robot.poses[0][:2]) if robot.times else None
    return Result(
        number=patrol.number,
        seed=patrol.seed,
        kind=patrol.kind,
        house=patrol.house,
        room=patrol.room,
        title=patrol.title,
        expected=patrol.expected,
        verdict=verdict,
        reason=reason,
        problem=problem,
        was_there=there.was_there or (verdict == CONFIRMED and there.was_seen),
        in_room=there.in_room,
        in_view=there.in_view,
        place_error=place_error(tracks, patrol.people, last, *person) if person else None,
        share_told=kept.share_seen if kept is not None else _share(heard, begin, end),
        share_true=true_share(floor, patrol.room, robot, triggered, triggered + looked) if looked else None,
        times={name: round(value, 2) for name, value in times.items()},
        contacts=contacts,
        touches=touches(heard.contacts, robot, tracks),
        localisation=heard.localisation(),
        home_error=home,
        home=None if home is None or went_on else home < HOME,
        suspects=[event.text for event in kept.events if event.kind == "suspect"] if kept is not None else [],
        mishap=patrol.mishap,
        allowed=patrol.allowed,
        people=len(patrol.people),
        mails=mails,
        missions=len({s.message.mission for s in heard.states if s.message.mission}),
        sim_s=round(robot.times[-1], 1) if robot.times else 0.0,
        wall_s=round(wall_s, 1),
    )


def _times(heard: Recording, patrol: Patrol, begin: int | None, end: int | None) -> tuple[Times, float | None]:
    """Seconds from the trigger to later events, and the time of the verdict."""
    if begin is None:
        return {}, None
    start = next((t for t, room in heard.triggers if room == patrol.room), heard.states[begin].time)
    states = heard.states[begin : None if end is None else end + 1]
    times: Times = {}
    goal = next((t for t in heard.goals if t >= start), None)
    if goal is not None:
        times["goal"] = goal - start
    for name, phase in (("arrived", PatrolState.LOOKING), ("looked", PatrolState.RETURNING)):
        at = next((s.time for s in states if s.message.state == phase), None)
        if at is not None:
            times[name] = at - start
    mission = heard.states[begin].message.mission
    alert = next((t for t, a in heard.alerts if a.id.startswith(mission) and a.kind == Alert.SEEN), None)
    mailed = next((t for t, a in heard.alerts if a.id.startswith(mission) and a.kind == Alert.DELIVERED), None)
    if alert is not None:
        times["notice"] = alert - start
    if mailed is not None:
        times["mail"] = mailed - start
    if end is not None:
        times["home"] = heard.states[end].time - start
    decided = alert if alert is not None else start + times["looked"] if "looked" in times else None
    return times, decided


def _from_view(there: Presence, heard: Recording) -> Times:
    if there.first_view is None:
        return {}
    alert = next((t for t, a in heard.alerts if a.kind == Alert.SEEN and t >= there.first_view - 1.0), None)
    return {} if alert is None else {"seen_to_notice": max(alert - there.first_view, 0.0)}


def _kept(state_dir: Path, mission: str | None) -> Incident | None:
    """The guard's own record of a mission, None without one."""
    if mission is None or not (state_dir / NAME).is_file():
        return None
    try:
        with IncidentStore(state_dir, read_only=True) as store:
            return store.get(mission)
    except StoreError as err:
        log.error("the incident %s cannot be read: %s", mission, err)
        return None


def _share(heard: Recording, begin: int | None, end: int | None) -> float | None:
    """Share of the floor reported by the guard during a mission, None if it reported none."""
    if begin is None:
        return None
    shares = [float(s.message.share_seen) for s in heard.states[begin : None if end is None else end + 1]]
    return max(shares) if shares and max(shares) >= 0.0 else None
