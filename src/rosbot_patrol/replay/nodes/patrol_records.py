"""Conversion of the patrol's input messages to plain records without ROS."""

from __future__ import annotations

from typing import Any, NamedTuple

from rosbot_patrol.patrol.guard.battery import battery_of
from rosbot_patrol.patrol.records.inputs import Battery, Box
from rosbot_patrol.patrol.senses.records import (
    BoxesRecord,
    CountRecord,
    ImageRecord,
    LensRecord,
    LookRecord,
    TriggerRecord,
    lens_record,
)
from rosbot_patrol.replay.bags import raw_ros1
from rosbot_patrol.replay.bags.definitions import STAMP
from rosbot_patrol.replay.bags.records import ANY, Kind, Refused, stamp_of
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5

CHARGING = 1  # sensor_msgs/BatteryState.POWER_SUPPLY_STATUS_CHARGING
LOOK = "look"  # rosbot_patrol/SensorEvent.LOOK


class GoalRecord(NamedTuple):
    """move_base_msgs/MoveBaseActionGoal: goal id."""

    goal: str


class OutcomeRecord(NamedTuple):
    """move_base_msgs/MoveBaseActionResult: goal id, status (actionlib_msgs/GoalStatus), status text."""

    goal: str
    status: int
    text: str


class ModeRecord(NamedTuple):
    """rosbot_patrol/Arming: mode, guarded rooms (None: all), quiet hours, entry delay in seconds, reason."""

    mode: str
    rooms: frozenset[int] | None
    is_quiet: bool
    entry_delay: float
    why: str


class StopRecord(NamedTuple):
    """std_msgs/Bool on /e_stop."""

    is_pressed: bool


class AliveRecord(NamedTuple):
    """The arrival of a message, without its contents."""


def _boxes(message: Any) -> BoxesRecord:
    boxes = tuple(
        Box(label=b.Class, probability=b.probability, xmin=b.xmin, ymin=b.ymin, xmax=b.xmax, ymax=b.ymax)
        for b in message.bounding_boxes
    )
    return BoxesRecord(stamp_of(message.image_header.stamp) or stamp_of(message.header.stamp), boxes)


def _lens(message: Any) -> LensRecord | Refused:
    k = message.K if hasattr(message, "K") else message.k  # names in ROS 1 and ROS 2
    try:
        return lens_record(message.header.frame_id, k, width=message.width, height=message.height)
    except ValueError as err:
        return Refused(str(err))


def _image(message: Any) -> ImageRecord:
    stamp, is_big_endian = stamp_of(message.header.stamp), bool(message.is_bigendian)
    size = int(message.height), int(message.width)
    return ImageRecord(stamp, *size, message.encoding, is_big_endian, int(message.step), message.data.tobytes())


def _battery(message: Any) -> Battery:
    is_charging = message.power_supply_status == CHARGING
    return battery_of(message.percentage, message.voltage, is_present=bool(message.present), is_charging=is_charging)


def _mode(message: Any) -> ModeRecord:
    rooms = None if message.all_rooms else frozenset(int(room) for room in message.rooms)
    return ModeRecord(message.mode, rooms, bool(message.quiet), float(message.entry_delay), message.why)


def _event(message: Any) -> LookRecord:
    is_asked = message.kind == LOOK and message.active
    return LookRecord(int(message.room) if is_asked else -1, message.text)


def _outcome(message: Any) -> OutcomeRecord:
    status = message.status
    return OutcomeRecord(status.goal_id.id, int(status.status), status.text)


def _alive(_raw: bytes) -> AliveRecord:
    return AliveRecord()


def _trigger(raw: bytes) -> TriggerRecord:
    return TriggerRecord(raw[0], bool(raw[1]))


def _count(raw: bytes) -> CountRecord:
    return CountRecord(*raw_ros1.read_count(raw))


_TRIGGER = Kind(
    lambda message: TriggerRecord(int(message.id), bool(message.move)),
    {"id": "int", "move": "bool"},
    _trigger,
    ESP_TRIGGER_MD5,
)
_ALIVE = Kind(lambda _message: AliveRecord(), {}, _alive, ANY)
_CORNERS = {f"bounding_boxes[].{name}": "int" for name in ("xmin", "ymin", "xmax", "ymax")}

KINDS: dict[str, Kind] = {
    "rosbot_patrol/msg/EspTrigger": _TRIGGER,
    "rosbot_patrol_simulation/msg/EspTrigger": _TRIGGER,
    "darknet_ros_msgs/msg/BoundingBoxes": Kind(
        _boxes,
        STAMP
        | {"image_header.stamp.sec": "int", "bounding_boxes[].Class": "string", "bounding_boxes[].probability": "float"}
        | _CORNERS,
    ),
    "darknet_ros_msgs/msg/ObjectCount": Kind(
        lambda message: CountRecord(stamp_of(message.header.stamp), int(message.count)),
        STAMP | {"count": "int"},
        _count,
        raw_ros1.COUNT_MD5,
    ),
    "sensor_msgs/msg/CameraInfo": Kind(_lens, STAMP | {"width": "int", "height": "int"}),
    "sensor_msgs/msg/BatteryState": Kind(
        _battery, {"percentage": "float", "voltage": "float", "present": "bool", "power_supply_status": "int"}
    ),
    "move_base_msgs/msg/MoveBaseActionGoal": Kind(
        lambda message: GoalRecord(message.goal_id.id),
        {"goal_id.id": "string"},
        lambda raw: GoalRecord(raw_ros1.read_goal(raw)),
        raw_ros1.GOAL_MD5,
    ),
    "move_base_msgs/msg/MoveBaseActionResult": Kind(
        _outcome,
        {"status.goal_id.id": "string", "status.status": "int", "status.text": "string"},
        lambda raw: OutcomeRecord(*raw_ros1.read_result(raw)),
        raw_ros1.RESULT_MD5,
    ),
    "actionlib_msgs/msg/GoalStatusArray": _ALIVE,
    "sensor_msgs/msg/Image": Kind(
        _image,
        STAMP
        | {"height": "int", "width": "int", "step": "int", "is_bigendian": "int"}
        | {"encoding": "string", "data": "int[]"},
        lambda raw: ImageRecord(*raw_ros1.read_image(raw)),
        raw_ros1.IMAGE_MD5,
    ),
    "sensor_msgs/msg/CompressedImage": _ALIVE,
    "rosbot_patrol/msg/Arming": Kind(
        _mode,
        {"mode": "string", "all_rooms": "bool", "rooms": "int[]", "quiet": "bool"}
        | {"entry_delay": "float", "why": "string"},
    ),
    "rosbot_patrol/msg/SensorEvent": Kind(
        _event, {"kind": "string", "active": "bool", "room": "int", "text": "string"}
    ),
    "std_msgs/msg/Bool": Kind(lambda message: StopRecord(bool(message.data)), {"data": "bool"}),
}
