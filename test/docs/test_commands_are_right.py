"""Each command of each page, as it stands: files, programs, arguments, options and messages are there."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("roslaunch", reason="ROS is not on the path: `. scripts/env` first")
from command_check import ROOT, problem_of
from page_commands import Command, commands_of
from page_list import PAGES


def commands(page: str) -> list[Command]:
    return commands_of(page, (ROOT / page).read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", PAGES)
def test_a_pages_commands_are_right(page: str) -> None:
    problems = [
        f"{command.where}: {command.text}: {problem}" for command in commands(page) if (problem := problem_of(command))
    ]
    assert problems == []


def test_the_pages_hold_commands_that_run() -> None:
    """Counted, so that neither a marker nor a change of the extractor takes most of them out."""
    modes = [command.mode for page in PAGES for command in commands(page)]
    assert modes.count("run") >= 30
    assert modes.count("run") + modes.count("long") >= 45
    assert modes.count("not run") <= 58


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("roslaunch rosbot_patrol rosbot_patrol.launch hous:=flat", "has no argument hous:="),
        ("roslaunch rosbot_patrol patrol.launch", "has no patrol.launch"),
        ("roslaunch rosbot_patrl patrol.launch", "no package rosbot_patrl"),
        ("roslaunch rosbot_patrol darknet_yolo_only.launch network:=yolov9", "does not load"),
        ("roslaunch rosbot_patrol demo.launch room:=8 map_file:=$PWD/m.yaml", ""),
        ("rosrun rosbot_patrol marks", "has no program marks"),
        ("rosrun rosbot_patrol incidents lst", "has no 'lst'"),
        ("rosrun rosbot_patrol incidents list --rom 3", "has no option --rom"),
        ("rosrun rosbot_patrol incidents prune --keep-days 3", ""),
        ('rosservice call /simulator/set_fault motion_flapping 5 "{}" 0.0', "do not fit"),
        ("rosservice call /simulator/set_fault \"{kind: motion_flapping, target: '5'}\"", ""),
        ("rosservice call /simulator/set_fault \"{kind: motion_flapping, sensor: '5'}\"", "do not fit"),
        ("rosservice call /simulator/set_falt x", "no program of ours offers"),
        ("rosservice call /patrol/emergency_stop true", ""),
        ("rosservice call /patrol/all true", "do not fit"),
        ("rostopic pub -1 /motion_trigger rosbot_patrol/EspTriger '{id: 1}'", "no message"),
        ("rostopic pub -1 /motion_trigger rosbot_patrol/EspTrigger '{room: 1}'", "do not fit"),
        ("rostopic pub -1 /motion_trigger rosbot_patrol/EspTrigger '{id: 300}'", "do not fit"),
        ("rosbag recrd /scan", "has no 'recrd'"),
        ("scripts/patrl", "is no program"),
        ("scripts/patrol rom:=3", "takes no rom:="),
        ("scripts/patrol scenario:=scenarios/two_intruder.yaml", "there is no scenarios/two_intruder.yaml"),
        ("scripts/test --longer", "has no option --longer"),
        ("make -C firmware/host chek", "has no rule chek"),
        ("pytest test/unit", "no pytest that knows our packages"),
        ("python -m rosbot_patrol.kernels", "no python that knows our packages"),
        (".ws/venv/bin/python -m rosbot_patrol.kernel", "no module rosbot_patrol.kernel"),
        (".ws/venv/bin/python -m pytest test/units/alerts", "there is no test/units/alerts"),
        ("cp config/sensor.yaml x.yaml", "there is no config/sensor.yaml"),
    ],
)
def test_what_is_wrong_is_found(text: str, problem: str) -> None:
    found = problem_of(Command(page="page.md", line=1, text=text, mode="run"))
    assert problem in found if problem else not found, found


def test_the_repository_is_where_the_pages_are() -> None:
    assert Path(ROOT, "README.md").is_file()
