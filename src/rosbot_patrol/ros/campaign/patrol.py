"""Runs one patrol of a campaign in the real house, and records the result."""

from __future__ import annotations

import json
import os
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rosbot_patrol.campaign.crash_ledger import KeptMail
from rosbot_patrol.campaign.houses.files import HOUSES, scenario_files
from rosbot_patrol.campaign.plan import CONFIRMED, WITHIN, Patrol, patrol_from_plain, scenario_text
from rosbot_patrol.campaign.record import PLAN, RESULT, Result
from rosbot_patrol.files import write_atomic
from rosbot_patrol.ros.campaign.evaluation import Mission, Run, evaluate
from rosbot_patrol.ros.campaign.house import House, HouseError, Master
from rosbot_patrol.ros.campaign.mail_sink import kept_mails
from rosbot_patrol.ros.campaign.watch import CampaignWatch
from rosbot_patrol.simulation.scenario.file import read_scenario

READY = 120.0  # longest wait for the house to be on guard [s]
MAIL = 20.0  # longest wait for a mail after the mission [s]
NEXT = 1.0  # simulated time after a mission in which a waiting one has begun [s]


@dataclass(frozen=True, kw_only=True)
class Eyes:
    """What the guard looks with, and at.

    Attributes:
        network: that looks for people.
        figures: of the simulated people, plain or detailed.
        is_hardware: through emulated devices and a robot's drivers, in real time.
    """

    network: str = "house"
    figures: str = "plain"
    is_hardware: bool = False


def play(folder: Path, root: Path, limit: float, eyes: Eyes) -> Result:
    """Run the patrol planned in a folder.

    Args:
        folder: with the plan; receives the result, mails, state and log.
        root: of the package.
        limit: for all of it [s] of real time.
        eyes: network and figures.
    """
    patrol = patrol_from_plain(json.loads((folder / PLAN).read_text(encoding="utf-8")))
    files = scenario_files(patrol.house, patrol.scenario, folder, root)
    patrol = replace(patrol, scenario={**patrol.scenario, **files.entries()})
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
        "console": "false",  # nobody looks
        "house": patrol.house if patrol.house in HOUSES else HOUSES[0],
        "network": eyes.network,
        "figures": eyes.figures,
    }
    scenario = read_scenario(file)
    arguments |= scenario.launch_arguments
    if scenario.robot is not None:
        start = scenario.robot
        arguments |= {"start_x": start.x, "start_y": start.y, "start_yaw": start.yaw}
    if eyes.is_hardware:  # devices on wires have a clock of their own
        arguments |= {"simulation": "hardware", "rate": 1, "hardware_folder": folder / "devices"}
    house = House(folder, "rosbot_patrol", "scenario.launch", **arguments)
    problem = ""
    try:
        house.start()
        house.wait_ready(min(READY, limit))
        _wait_for_the_end(house, watch, patrol, began + limit)
    except HouseError as err:
        problem = str(err).splitlines()[0]
    finally:
        mails = [notice.incident for notice in _notices(house)]
        contacts = [other for kind, other in house.contacts if kind != "floor"]
        house.stop()
        watch.stop()
        master.stop()
    run = Run(problem=problem, mails=mails, contacts=contacts, wall_s=time.monotonic() - began)
    result = evaluate(patrol, watch.heard, files, folder / "state", run)
    write_atomic(folder / RESULT, result.to_json().encode())
    return result


def _wait_for_the_end(house: House, watch: CampaignWatch, patrol: Patrol, until: float) -> None:
    """Wait until the mission to the room is over and its mail has arrived."""

    def is_over() -> bool:
        end = Mission(watch.heard, patrol.room).end
        return end is not None and watch.now > end.time + NEXT

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
