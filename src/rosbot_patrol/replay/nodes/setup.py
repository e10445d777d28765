"""Setup of a replay (node, parameters, map, missing transforms), and the replays by their nodes' names."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rosbot_patrol import params
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.detection.choice import NetworkFolders, choose_detector
from rosbot_patrol.detection.params import DarknetParams
from rosbot_patrol.errors import ParamError
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.package_files import package_file, package_folder, read_move_base
from rosbot_patrol.patrol.belief.networks import Network, find_calibration
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.patrol.intruder.known_objects import load_known
from rosbot_patrol.patrol.mission.params import NodeParams, manager_params
from rosbot_patrol.patrol.senses.params import InputParams
from rosbot_patrol.replay.nodes import amcl as amcl_replay
from rosbot_patrol.replay.nodes import bridge as serial_replay
from rosbot_patrol.replay.nodes import detector as detector_replay
from rosbot_patrol.replay.nodes import gmapping as gmapping_replay
from rosbot_patrol.replay.nodes import move_base as move_base_replay
from rosbot_patrol.replay.nodes import patrol as patrol_replay
from rosbot_patrol.replay.nodes import patrol_log
from rosbot_patrol.replay.results.comparison import Field
from rosbot_patrol.replay.runner import Input, Replay
from rosbot_patrol.rosserial.server.settings import SerialNodeParams
from rosbot_patrol.sensors.sensor_file import load_sensors
from rosbot_patrol.tf.tree import Edge
from rosbot_patrol.yaml_files import read_mapping

POINTS = "params/room_points.yaml"


@dataclass(frozen=True, kw_only=True)
class Setup:
    """The setup of a replay.

    Attributes:
        node: name of the node.
        tree: its parameters; None: those of the package's config.
        name: prefix of the parameters in messages.
        map: yaml of the map, None for the bag's.
        static: transforms that the bag lacks.
        seed: seed of all random numbers.
        rooms: points file of the patrol, None for the parameter path_to_params or the package's.
    """

    node: str
    tree: Mapping[str, Any] | None = None
    name: str = "~"
    map: Path | None = None
    static: Sequence[Edge] = field(default_factory=tuple)
    seed: int = 0
    rooms: Path | None = None


@dataclass(frozen=True)
class Node:
    """A node that can be replayed.

    Attributes:
        config: file of its parameters in the package, "" for none.
        build: makes its replay from a setup; raises ParamError or MapError.
        fields: tolerances of its result.
        inputs: its default inputs.
    """

    config: str
    build: Callable[[Setup], Replay]
    fields: Mapping[str, Field]
    inputs: Sequence[Input]


def build_replay(setup: Setup) -> Replay:
    """Make the replay of a setup.

    Raises:
        ParamError: the node or a parameter is unknown or invalid.
        MapError: the map cannot be used.
    """
    return node_of(setup.node).build(setup)


def node_of(name: str) -> Node:
    """Find a node by its name; raises ParamError, which names the nearest."""
    if name not in NODES:
        raise ParamError("node", params.unknown_name(name, NODES))
    return NODES[name]


def read_parameters(path: Path, node: str) -> Mapping[str, Any]:
    """Read the parameters of a node from a yaml, at the top level or under the node's name (as in `rosparam dump`).

    Raises:
        ParamError: the file cannot be read.
    """
    tree = read_mapping(path, keys=f"of {node}")
    own = tree.get(node)
    return own if isinstance(own, dict) else tree


def parse_transform(text: str) -> Edge:
    """Parse a static transform in static_transform_publisher's form: x y z yaw pitch roll (or a quaternion) PARENT
    CHILD.

    Raises:
        ParamError: it is invalid.
    """
    words = text.split()
    try:
        numbers = [float(word) for word in words[:-2]]
    except ValueError:
        numbers = []
    if len(numbers) not in (6, 7) or not all(map(math.isfinite, numbers)):
        expected = "expected 'x y z yaw pitch roll PARENT CHILD' or 'x y z qx qy qz qw PARENT CHILD'"
        raise ParamError("transform", f"{expected}, got '{text}'")
    turn = numbers[3:] if len(numbers) == 7 else _quaternion(*numbers[3:])
    return Edge(words[-2], words[-1], 0.0, *numbers[:3], *turn)


def _quaternion(yaw: float, pitch: float, roll: float) -> tuple[float, float, float, float]:
    """Quaternion of rotations about z, then the rotated y, then the rotated x axis [rad]."""
    (sr, sp, sy), (cr, cp, cy) = ((f(roll / 2), f(pitch / 2), f(yaw / 2)) for f in (math.sin, math.cos))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def _parameters(setup: Setup) -> tuple[Mapping[str, Any], str]:
    if setup.tree is not None:
        return setup.tree, setup.name
    path = package_file(node_of(setup.node).config)
    return read_parameters(path, setup.node), f"{path}: "


def _amcl(setup: Setup) -> Replay:
    tree, name = _parameters(setup)
    loaded = params.load(AmclParams, tree, name=name, ignore=["saved_pose"])
    grid = None if setup.map is None else read_map(setup.map)
    return amcl_replay.AmclReplay(loaded, grid=grid, seed=setup.seed, static=setup.static)


def _gmapping(setup: Setup) -> Replay:
    tree, name = _parameters(setup)
    changes: dict[str, Any] = {"seed": setup.seed} if setup.seed else {}
    if setup.map is not None:
        changes["map_file"] = str(setup.map)
    return gmapping_replay.GmappingReplay(
        params.load(GmappingParams, {**tree, **changes}, name=name), static=setup.static
    )


def _patrol(setup: Setup) -> Replay:
    tree, name = _parameters(setup)
    points = setup.rooms or tree.get("path_to_params") or package_file(POINTS)
    own = {**tree, "path_to_params": str(points)}
    node = params.load(NodeParams, own, name=name, ignore=set(tree))
    frames = params.load(InputParams, tree, name=name, ignore=set(tree))
    rooms = load_rooms(Path(points))
    names = {room.id: room.name for room in rooms}
    return patrol_replay.PatrolReplay(
        node,
        manager_params(node, lambda cls: params.load(cls, tree, name=name, ignore=set(tree)), name),
        frames,
        rooms=rooms,
        sensors=load_sensors(node.sensors, names, rooms_source=str(rooms.source)),
        known=load_known(node.known_objects),
        network=_network(node),
        static=setup.static,
    )


def _network(node: NodeParams) -> Network:
    """The network of the bag's boxes: the shipped one, unless the parameters name another."""
    own = [Path(node.calibrations).expanduser()] if node.calibrations else []
    return Network(find_calibration([*own, package_file("config/calibrations")], node.network or "house"))


def _detector(setup: Setup) -> Replay:
    tree, name = _parameters(setup)
    loaded = params.load(DarknetParams, tree, name=name)
    topic = loaded.subscribers.camera_reading.topic
    folders = NetworkFolders(own=package_file("models"), darknet=package_folder("darknet_ros"))
    detector = choose_detector(loaded, folders).detector
    is_named = "subscribers" in tree
    return detector_replay.DetectorReplay(detector, topic if is_named else detector_replay.INPUTS[0].topic)


def _move_base(setup: Setup) -> Replay:
    folder = package_file(node_of(setup.node).config)
    tree, name = (read_move_base(folder), f"{folder}: ") if setup.tree is None else (setup.tree, setup.name)
    grid = None if setup.map is None else read_map(setup.map)
    return move_base_replay.MoveBaseReplay(tree, name, grid=grid, static=setup.static)


def _serial(setup: Setup) -> Replay:
    tree, name = ({"port": "tcp"}, "") if setup.tree is None else (setup.tree, setup.name)
    loaded = params.load(SerialNodeParams, tree, name=name)
    silence = loaded.silence_timeout if loaded.is_tcp else None
    return serial_replay.SerialReplay(loaded.policy(name), silence)


NODES: dict[str, Node] = {
    "amcl": Node("config/tuned/amcl.yaml", _amcl, amcl_replay.FIELDS, amcl_replay.INPUTS),
    "darknet_ros": Node("models/house.yaml", _detector, detector_replay.FIELDS, detector_replay.INPUTS),
    "move_base": Node("config/tuned", _move_base, move_base_replay.FIELDS, move_base_replay.INPUTS),
    "patrol_robot": Node("", _patrol, patrol_log.FIELDS, patrol_replay.INPUTS),
    "serial_node": Node("", _serial, serial_replay.FIELDS, serial_replay.INPUTS),
    "slam_gmapping": Node("config/gmapping.yaml", _gmapping, gmapping_replay.FIELDS, gmapping_replay.INPUTS),
}
