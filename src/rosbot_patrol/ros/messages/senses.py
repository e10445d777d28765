"""Conversion of the patrol's input messages to records of its senses."""

from __future__ import annotations

from darknet_ros_msgs.msg import BoundingBoxes, ObjectCount
from sensor_msgs.msg import BatteryState, CameraInfo, Image

from rosbot_patrol.msg import EspTrigger, SensorEvent
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


def trigger_from_msg(msg: EspTrigger) -> TriggerRecord:
    """A motion sensor's trigger or heartbeat."""
    return TriggerRecord(msg.id, bool(msg.move))


def boxes_from_msg(msg: BoundingBoxes) -> BoxesRecord:
    """Boxes of the detector, with the picture's time if it has one, else the message's."""
    boxes = tuple(
        Box(label=b.Class, probability=b.probability, xmin=b.xmin, ymin=b.ymin, xmax=b.xmax, ymax=b.ymax)
        for b in msg.bounding_boxes
    )
    return BoxesRecord(msg.image_header.stamp.to_sec() or msg.header.stamp.to_sec(), boxes)


def count_from_msg(msg: ObjectCount) -> CountRecord:
    """Number of objects of the detector."""
    return CountRecord(msg.header.stamp.to_sec(), msg.count)


def lens_from_msg(msg: CameraInfo) -> LensRecord:
    """A camera's frame and lens; raises ValueError if the message describes none."""
    return lens_record(msg.header.frame_id, msg.K, width=msg.width, height=msg.height)


def image_from_msg(msg: Image) -> ImageRecord:
    """A picture, not yet decoded."""
    stamp, is_big_endian = msg.header.stamp.to_sec(), bool(msg.is_bigendian)
    return ImageRecord(stamp, msg.height, msg.width, msg.encoding, is_big_endian, msg.step, msg.data)


def battery_from_msg(msg: BatteryState) -> Battery:
    """State of the battery, not yet stamped."""
    is_charging = msg.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_CHARGING
    return battery_of(msg.percentage, msg.voltage, is_present=bool(msg.present), is_charging=is_charging)


def look_from_msg(msg: SensorEvent) -> LookRecord:
    """The room that a sensor's event asks the patrol to look at."""
    is_asked = msg.kind == SensorEvent.LOOK and msg.active
    return LookRecord(msg.room if is_asked else -1, msg.text)
