"""The parameters of the patrol's behaviour.

The parameters of patrol_robot itself, without those of mail and records.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rosbot_patrol.params import param
from rosbot_patrol.patrol.calls.queue import PriorityParams
from rosbot_patrol.patrol.guard.battery import BatteryParams, check_battery
from rosbot_patrol.patrol.intruder.camera_tracking import TrackParams
from rosbot_patrol.patrol.intruder.exclusions import JudgeParams
from rosbot_patrol.patrol.intruder.persons import PeopleParams
from rosbot_patrol.patrol.intruder.sightings import WatchParams
from rosbot_patrol.patrol.intruder.weak_sightings import SuspectParams
from rosbot_patrol.patrol.mission.drive import DriveParams
from rosbot_patrol.patrol.search.look import LookParams
from rosbot_patrol.patrol.search.room_search import SightParams
from rosbot_patrol.patrol.search.turn import SpinParams

ALARM_CLASSES = ["person", "fire hydrant"]


@dataclass(frozen=True, kw_only=True)
class BehaviourParams:
    """What the node and its manager share."""

    alarm_classes: list[str] = param(ALARM_CLASSES, doc="classes of objects that alarm")
    own_motion_radius: float = param(
        2.0, unit="m", lo=0.0, doc="so near to a room's point the moving robot is what its sensor sees"
    )
    own_motion_memory: float = param(
        2.0, unit="s", lo=0.0, hi=60.0, doc="so long after it was near the robot is still what the sensor saw"
    )
    resume_max_age: float = param(
        43200.0, unit="s", lo=0.0, doc="a call that is older than this after a restart is reported, not followed"
    )


@dataclass(frozen=True, kw_only=True)
class ManagerParams(BehaviourParams):
    """The patrol's behaviour."""

    drive: DriveParams = DriveParams()
    look: LookParams = LookParams()
    spin: SpinParams = SpinParams()
    watch: WatchParams = WatchParams()
    suspects: SuspectParams = SuspectParams()
    people: PeopleParams = PeopleParams()
    track: TrackParams = TrackParams()
    priorities: PriorityParams = PriorityParams()
    battery: BatteryParams = BatteryParams()


@dataclass(frozen=True, kw_only=True)
class EyesTopics:
    """Where camera, depth and map are heard."""

    camera_info_topic: str = param("camera/rgb/camera_info", doc="lens of the camera that the detector looks through")
    depth_topic: str = param(
        "camera/depth/image_raw", doc="depth in m (32FC1) or mm (16UC1), for places and posters; empty: none"
    )
    depth_info_topic: str = param(
        "camera/depth/camera_info", doc="lens of the depth camera; silent: the colour camera's"
    )
    depth_reach: float = param(
        4.5,
        unit="m",
        lo=0.0,
        doc="what is farther than depth tells, and stands on nothing new, is looked at from nearer",
    )
    view_range: float = param(8.0, unit="m", lo=0.5, doc="so far off is what no beam comes back from")
    floor_height: float = param(
        -0.04, unit="m", doc="height of the floor in the map's frame: base_link is at the axles"
    )
    off_map: float = param(
        0.3, unit="m", lo=0.05, hi=1.0, doc="a lidar's point so far from all on the map is not of it"
    )


@dataclass(frozen=True, kw_only=True)
class InputParams:
    """Where the patrol's inputs come from, and how long they are good."""

    base_frame: str = param("base_link", doc="the robot")
    odom_frame: str = param("odom", doc="frame in which a turn is measured")
    map_frame: str = param("map", doc="frame of the points file")
    pose_timeout: float = param(0.5, unit="s", lo=0.05, doc="an older odom -> base_link is not known")
    map_timeout: float = param(
        2.0, unit="s", lo=0.1, doc="maximum age of map -> odom, which amcl repeats with each scan; older: no pose"
    )
    scan_timeout: float = param(1.0, unit="s", lo=0.05, doc="an older scan says nothing of obstacles")
    battery_topic: str = param("battery", doc="state of the battery (TurtleBot3: battery_state)")
    latched_window: float = param(
        10.0, unit="s", lo=0.0, doc="so long after its start a latched trigger that it had before is not taken again"
    )


@dataclass(frozen=True, kw_only=True)
class NodeParams(BehaviourParams, SightParams):
    """The node's own parameters; those of mail, drive, look, turn and watch come beside them."""

    path_to_params: str = param(doc="points file (the tutorial's name)")
    sensors: str = param("", doc="file of the sensors; empty or none: a sensor's id is the number of its room")
    state_dir: str = param(
        "", doc="folder of outbox, incidents and queue; empty: rosbot_patrol(-NAMESPACE) in ROS's home"
    )
    image_topic: str = param("camera/rgb/image_raw", doc="camera for the mail's picture; empty: none")
    rate: float = param(25.0, unit="Hz", lo=5.0, hi=100.0, doc="steps of the patrol, at most")
    sensor_watch_after: float = param(
        20.0, unit="s", lo=6.0, doc="a sensor_watch that was there and says nothing for so long has gone, or hangs"
    )
    sensor_watch_notice_after: float = param(
        60.0, unit="s", lo=0.0, doc="that lasting so long the owner is told, and again when it is over for so long"
    )
    schedule: str = param("", doc="file of the rounds; empty: none")
    arming: str = param("", doc="file of the modes; empty: all rooms in each mode, without delays")
    known_objects: str = param("", doc="file of things that look like somebody (patrol/known_objects); empty: none")
    watch: WatchParams = WatchParams()
    suspects: SuspectParams = SuspectParams()
    judge: JudgeParams = JudgeParams()
    track: TrackParams = TrackParams()
    people: PeopleParams = PeopleParams()
    eyes: EyesTopics = EyesTopics()


def manager_params(node: NodeParams, load: Callable[[type[Any]], Any], prefix: str) -> ManagerParams:
    """Everything that the manager is told.

    Args:
        node: the node's own parameters.
        load: gives one of the groups that share the node's flat namespace.
        prefix: of the names in messages.

    Raises:
        ParamError: a parameter makes no sense.
    """
    battery = load(BatteryParams)
    check_battery(battery, prefix)
    return ManagerParams(
        alarm_classes=node.alarm_classes,
        own_motion_radius=node.own_motion_radius,
        own_motion_memory=node.own_motion_memory,
        resume_max_age=node.resume_max_age,
        priorities=load(PriorityParams),
        battery=battery,
        drive=load(DriveParams),
        look=load(LookParams),
        spin=load(SpinParams),
        watch=node.watch,
        suspects=node.suspects,
        people=node.people,
        track=node.track,
    )
