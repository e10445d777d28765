"""Generator of docs/launch.md from the launch files; `scripts/parameter_tables` writes it with docs/parameters.md."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

# Launch files in the page's order, each with its purpose.
FILES = {
    "rosbot_patrol": "The whole guard, simulated or on the robot; `scripts/patrol` takes the same arguments.",
    "demo": "The simulated house with an intruder: what `scripts/patrol` runs.",
    "new_house": "Set-up of a new house by a guide on the console's page ([console](console.md#a-new-house)).",
    "scenario": "The simulated house with a scenario played in it ([scenarios](scenarios.md)).",
    "rosbot_patrol_pc": "Detector and sensor bridge on a PC (`detector:=pc` on the robot).",
    "simulation_gmapping": "Map a simulated house ([mapping](mapping.md)).",
    "rosbot_gmapping": "Map a house with the robot ([mapping](mapping.md)).",
    "mark_rooms": "A map in rviz without a guard, to mark rooms on it ([your own house](own_house.md)).",
    "rviz": "What the robot sees, knows and plans, in rviz.",
    "simulation_start": "The simulator alone: house, robot and motion sensors.",
    "simulation_world": "The simulator with everything that drives the robot, without patrol and detector.",
    "rosbot_all_hardware": "The drivers of a ROSbot.",
    "turtlebot3_all_hardware": "The drivers of a TurtleBot3.",
    "rosbot_all_algorithms": "Localisation, navigation, command multiplexer and keyboard.",
    "amcl_only": "Localisation alone.",
    "move_base_only": "Navigation alone.",
    "gmapping_only": "Mapping alone.",
    "command_mux": "The one publisher of `cmd_vel`: priorities, emergency stop, collision guard.",
    "darknet_yolo_only": "The detector alone, on the picture that came over the network.",
    "darknet_yolo_simulation_only": "The detector alone, on the simulated camera.",
    "esp_connector": "The bridges of the motion sensors.",
    "teleop": "The keyboard.",
}

_INTRODUCTION = """# Launch files and their arguments

    roslaunch rosbot_patrol rosbot_patrol.launch house:=flat rviz:=true

`NAME:=VALUE` sets an argument. `roslaunch --ros-args rosbot_patrol rosbot_patrol.launch` lists them in the terminal.
A default that depends on other arguments is shown as `...`. This page is made from the launch files by
`scripts/parameter_tables`.
"""


def launch_page(folder: Path) -> str:
    """Make the whole page from the launch files in a folder."""
    return _INTRODUCTION + "".join(_section(folder / f"{name}.launch", purpose) for name, purpose in FILES.items())


def _section(path: Path, purpose: str) -> str:
    """Heading, purpose and table of one launch file; a comment before a group of arguments gets a row of its own."""
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    rows, group = [], ""
    for node in ElementTree.parse(path, parser).getroot():
        tag: object = node.tag
        if tag is ElementTree.Comment:
            group = " ".join((node.text or "").split())
        elif tag == "arg" and "default" in node.attrib:
            if group and path.stem == "rosbot_patrol" and len(group) < 40:
                rows.append(f"| **{group}** | | |")
            group = ""
            rows.append(f"| `{node.attrib['name']}` | {_default(node.attrib['default'])} | {node.attrib['doc']} |")
        else:
            group = ""
    table = "\n| argument | default | meaning |\n|---|---|---|\n" + "\n".join(rows) + "\n" if rows else ""
    return f"\n## {path.name}\n\n{purpose}\n{table}"


def _default(value: str) -> str:
    value = value.replace("$(find rosbot_patrol)/", "")
    return ("..." if "$(" in value else f"`{value}`") if value else "none"
