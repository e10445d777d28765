"""Generator of docs/parameters.md, docs/launch.md and the folder tree of docs/architecture.md."""

from __future__ import annotations

import dataclasses
import sys
import typing
from pathlib import Path

from rosbot_patrol.alerts.channels.params import SPECS, MailParams
from rosbot_patrol.alerts.pictures.ring import EvidenceParams
from rosbot_patrol.alerts.records.retention import RetentionParams
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.console.home_assistant.settings import BrokerSpec
from rosbot_patrol.console.web.server import ServerParams
from rosbot_patrol.control.teleop import TeleopParams
from rosbot_patrol.costmap.params import (
    CostmapParams,
    InflationParams,
    KeepoutParams,
    ObstacleParams,
    StaticParams,
    VoxelParams,
)
from rosbot_patrol.costmap.sensor_params import DepthSourceParams, RangeSensorParams, SourceParams
from rosbot_patrol.detection.params import DarknetParams
from rosbot_patrol.drivers.bases.adapter import AdapterParams
from rosbot_patrol.ekf.params import EkfParams, InputParams
from rosbot_patrol.gmapping.parameters import GmappingParams
from rosbot_patrol.images.compressed import CompressedParams
from rosbot_patrol.images.compressed_depth import CompressedDepthParams
from rosbot_patrol.navigation.params import MoveBaseParams
from rosbot_patrol.params import declared, table
from rosbot_patrol.patrol.calls.queue import PriorityParams
from rosbot_patrol.patrol.guard.battery import BatteryParams
from rosbot_patrol.patrol.mission.drive import DriveParams
from rosbot_patrol.patrol.mission.params import NodeParams
from rosbot_patrol.patrol.search.look import LookParams
from rosbot_patrol.patrol.search.turn import SpinParams
from rosbot_patrol.patrol.senses.params import InputParams as SenseParams
from rosbot_patrol.planning.global_planners.global_planner import GlobalPlannerParams
from rosbot_patrol.planning.global_planners.navfn import NavfnParams
from rosbot_patrol.planning.local_planners.dwa_params import DWAPlannerParams
from rosbot_patrol.planning.local_planners.trajectory_params import TrajectoryPlannerParams
from rosbot_patrol.planning.recoveries import ClearCostmapParams, MoveSlowParams, RotateParams
from rosbot_patrol.ros.console.home_assistant_node import HomeAssistantParams
from rosbot_patrol.ros.console.node import ConsoleParams
from rosbot_patrol.ros.detector.republish_node import RepublishParams
from rosbot_patrol.ros.drive.twist_mux_node import TwistMuxParams
from rosbot_patrol.ros.drivers.astra_depth_node import AstraDepthParams
from rosbot_patrol.ros.drivers.lds_node import LdsParams
from rosbot_patrol.ros.drivers.rplidar_node import RplidarParams
from rosbot_patrol.ros.drivers.usb_cam_node import UsbCamParams
from rosbot_patrol.ros.drivers.wheel_odometry_node import WheelOdometryParams
from rosbot_patrol.ros.gmapping.explore_node import ExploreParams
from rosbot_patrol.ros.maps.server_node import MapServerParams
from rosbot_patrol.ros.patrol.incident_keeper import RecordParams
from rosbot_patrol.ros.sensors.graph_reader import GraphParams
from rosbot_patrol.ros.sensors.heartbeat import HeartbeatParams
from rosbot_patrol.ros.sensors.watch_node import SensorWatchParams
from rosbot_patrol.ros.simulator.demo_intruder_node import DemoParams
from rosbot_patrol.ros.simulator.node import SimulatorParams
from rosbot_patrol.ros.tools.foxglove_node import FoxgloveParams
from rosbot_patrol.ros.tools.launch_page import launch_page
from rosbot_patrol.ros.tools.narrator_node import NarratorParams
from rosbot_patrol.ros.tools.source_tree import with_tree
from rosbot_patrol.rosserial.server.settings import SerialNodeParams
from rosbot_patrol.sensors.sensor_file import SensorSpec
from rosbot_patrol.sensors.settings import LookTimes, NoticeTimes, WatchTimes
from rosbot_patrol.simulation.scenario import file as scenario
from rosbot_patrol.simulation.scenario.faults import KINDS, Doorway, Fault
from rosbot_patrol.simulation.scenario.furniture import MovedFurniture

# Title, namespace below the node's own, declaration.
SECTIONS: list[tuple[str, list[tuple[str, type]]]] = [
    (
        "patrol_robot",
        [
            ("", NodeParams),
            ("", SenseParams),
            ("", MailParams),
            ("", DriveParams),
            ("", LookParams),
            ("", SpinParams),
            ("", PriorityParams),
            ("", BatteryParams),
            ("", EvidenceParams),
            ("", RetentionParams),
            ("", RecordParams),
        ],
    ),
    (
        "move_base",
        [
            ("", MoveBaseParams),
            ("NavfnROS/", NavfnParams),
            ("GlobalPlanner/", GlobalPlannerParams),
            ("TrajectoryPlannerROS/", TrajectoryPlannerParams),
            ("DWAPlannerROS/", DWAPlannerParams),
            ("conservative_reset/, aggressive_reset/", ClearCostmapParams),
            ("rotate_recovery/", RotateParams),
            ("<name of a MoveSlowAndClear>/", MoveSlowParams),
            ("global_costmap/, local_costmap/", CostmapParams),
            ("<costmap>/static_layer/", StaticParams),
            ("<costmap>/obstacle_layer/", ObstacleParams),
            ("<costmap>/obstacle_layer/<source>/", SourceParams),
            ("<costmap>/obstacle_layer/<one of depth_sources>/", DepthSourceParams),
            ("<costmap>/inflation_layer/", InflationParams),
            ("<costmap>/<name of a VoxelLayer>/", VoxelParams),
            ("<costmap>/<name of a KeepoutLayer>/", KeepoutParams),
            ("<costmap>/<name of a RangeSensorLayer>/", RangeSensorParams),
        ],
    ),
    ("amcl", [("", AmclParams)]),
    ("slam_gmapping", [("", GmappingParams)]),
    ("explore", [("", ExploreParams)]),
    ("map_server", [("", MapServerParams)]),
    ("darknet_ros", [("", DarknetParams)]),
    (
        "republish",
        [
            ("", RepublishParams),
            ("/<out>/compressed/", CompressedParams),
            ("/<out>/compressedDepth/", CompressedDepthParams),
        ],
    ),
    ("serial_node.py", [("", SerialNodeParams)]),
    (
        "sensor_watch",
        [
            ("", SensorWatchParams),
            ("", WatchTimes),
            ("", NoticeTimes),
            ("", LookTimes),
            ("", GraphParams),
            ("", HeartbeatParams),
            ("", MailParams),
        ],
    ),
    ("twist_mux", [("", TwistMuxParams)]),
    ("rplidarNode", [("", RplidarParams)]),
    ("usb_cam_node", [("", UsbCamParams)]),
    ("astra_depth", [("", AstraDepthParams)]),
    ("base_adapter", [("", AdapterParams)]),
    ("wheel_odometry", [("", WheelOdometryParams)]),
    ("hlds_laser_publisher", [("", LdsParams)]),
    ("ekf_localization_node", [("", EkfParams), ("<odom0, pose0, twist0, imu0, odom1, ...>_", InputParams)]),
    ("teleop_twist_keyboard.py", [("", TeleopParams)]),
    ("simulator", [("", SimulatorParams)]),
    ("console", [("", ConsoleParams), ("", ServerParams)]),
    ("home_assistant", [("", HomeAssistantParams)]),
    ("narrator", [("", NarratorParams)]),
    ("foxglove", [("", FoxgloveParams)]),
    ("demo_intruder", [("", DemoParams)]),
]

# Title, key and declaration of the sections of a scenario file.
SCENARIO: list[tuple[str, type]] = [
    ("", scenario.Setting),
    ("robot", scenario.Start),
    ("actors[]", scenario.ActorEntry),
    ("walks[]", scenario.WalkEntry),
    ("doors[]", scenario.DoorEntry),
    ("door_moves[]", scenario.DoorMove),
    ("furniture[]", MovedFurniture),
    ("doorways/<name>", Doorway),
    ("triggers[]", scenario.Trigger),
    ("expect", scenario.Expect),
    ("faults[]", Fault),
]


def _groups(prefix: str, cls: type, group: object = None) -> list[tuple[str, type, object]]:
    """A declaration and its nested ones, with their namespaces and effective defaults."""
    found = [(prefix, cls, group)]
    hints = typing.get_type_hints(cls)
    for field, (name, _, default, _) in zip(dataclasses.fields(cls), declared(cls, group), strict=True):
        if dataclasses.is_dataclass(hints[field.name]):
            nested = None if default is dataclasses.MISSING else default
            found += _groups(f"{prefix}{name}/", hints[field.name], nested)
    return found


def document() -> str:
    """Make the whole page."""
    lines = [
        "# Parameters",
        "",
        "Made from the declarations in the code by `scripts/parameter_tables`; names and defaults of the drop-ins are",
        "upstream's.",
    ]
    for node, sections in SECTIONS:
        lines += ["", f"## {node}"]
        for prefix, cls in sections:
            for namespace, group, defaults in _groups(prefix, cls):
                rows = table(group, defaults)
                if rows.count("\n") > 1:
                    place = namespace if namespace.startswith("/") else f"~{namespace}"
                    lines += ["", *([f"`{place}`", ""] if namespace else []), rows]
    lines += ["", "## file of the sensors", "", "`sensors[]`", "", table(SensorSpec)]
    lines += ["", "## file of the channels"]
    for kind, spec in sorted(SPECS.items()):
        lines += ["", f"`channels/NAME/` with `type: {kind}`", "", table(spec)]
    lines += ["", "## file of the MQTT broker", "", table(BrokerSpec)]
    lines += ["", "## scenario file"]
    for place, cls in SCENARIO:
        lines += ["", *([f"`{place}`", ""] if place else []), table(cls)]
    common = table(Fault).splitlines()[2:]
    for kind, cls in KINDS.items():
        own = [row for row in table(cls).splitlines() if row not in common]
        lines += ["", f"`kind: {kind}`: {cls.__doc__}"]
        lines += ["", *own] if len(own) > 2 else []
    return "\n".join(lines) + "\n"


def pages(root: Path) -> dict[Path, str]:
    """The generated pages of a checkout, with their expected contents."""
    architecture = root / "docs/architecture.md"
    return {
        root / "docs/parameters.md": document(),
        root / "docs/launch.md": launch_page(root / "launch"),
        architecture: with_tree(architecture.read_text(encoding="utf-8"), root / "src/rosbot_patrol"),
    }


def main() -> int:
    """Write the pages, or with --check compare them; exit status 1 if one is out of date."""
    found = pages(Path(sys.argv[1]))
    if "--check" in sys.argv[2:]:
        old = [path for path, text in found.items() if not path.exists() or path.read_text(encoding="utf-8") != text]
        sys.stderr.writelines(f"{path} is out of date: run scripts/parameter_tables\n" for path in old)
        return 1 if old else 0
    for path, text in found.items():
        path.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
