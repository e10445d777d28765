"""Check that a bag's message definitions have the fields that a replay needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

STAMP = {"header.stamp.sec": "int", "header.stamp.nanosec": "int", "header.frame_id": "string"}
_POSE = {"position.x": "float", "position.y": "float"} | {f"orientation.{key}": "float" for key in "xyzw"}


def _below(name: str, fields: Mapping[str, str]) -> dict[str, str]:
    return {f"{name}.{key}": kind for key, kind in fields.items()}


TRANSFORM = (
    STAMP
    | {"child_frame_id": "string"}
    | {f"transform.translation.{key}": "float" for key in "xyz"}
    | {f"transform.rotation.{key}": "float" for key in "xyzw"}
)
SCAN = STAMP | {
    "angle_min": "float",
    "angle_increment": "float",
    "range_min": "float",
    "range_max": "float",
    "ranges": "float[]",
}
GRID = (
    STAMP
    | {"info.resolution": "float", "info.width": "int", "info.height": "int", "data": "int[]"}
    | _below("info.origin", _POSE)
)
TRANSFORMS = _below("transforms[]", TRANSFORM)
POSE_ESTIMATE = STAMP | _below("pose.pose", _POSE) | {"pose.covariance": "float[]"}


def know_headers(store: Typestore) -> None:
    """Treat a plain `Header` anywhere in a message as std_msgs's, as in ROS 1.

    rosbags does so only for a message's first field; darknet_ros_msgs/BoundingBoxes has another one.
    """
    header = store.fielddefs.get("std_msgs/msg/Header")
    named = {detail for _, fields in store.fielddefs.values() for _, (node, detail) in fields if node == Nodetype.NAME}
    missing = {str(name) for name in named if str(name).endswith("/msg/Header") and name not in store.fielddefs}
    if header is not None and missing:
        store.register(dict.fromkeys(missing, header))


def definition_problem(fielddefs: Mapping[str, Any], message_type: str, needed: Mapping[str, str]) -> str:
    """Needed fields that a definition lacks or has with another type, "" if it has all.

    Args:
        fielddefs: rosbags' definitions by type: (constants, fields).
        message_type: the type to check.
        needed: dotted names ("[]" behind a list) and their kinds: int, float, string, int[], float[].
    """
    for name, kind in needed.items():
        found = _kind_of(fielddefs, message_type, name.split("."))
        if not found:
            return f"its definition has no field '{name}'"
        if found != kind:
            return f"the field '{name}' of its definition is {found}, expected {kind}"
    return ""


def _kind_of(fielddefs: Mapping[str, Any], message_type: str, path: Sequence[str]) -> str:
    """The kind of a field, "" if it does not exist."""
    name, rest = path[0].removesuffix("[]"), path[1:]
    descriptor = dict(fielddefs[message_type][1]).get(name) if message_type in fielddefs else None
    if descriptor is None:
        return ""
    if not rest:
        return _spelled(descriptor)
    node, detail = descriptor
    if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        node, detail = detail[0]
    return _kind_of(fielddefs, detail, rest) if node == Nodetype.NAME else ""


def _spelled(descriptor: Any) -> str:
    node, detail = descriptor
    if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return f"{_spelled(detail[0])}[]"
    if node == Nodetype.NAME:
        return str(detail)
    base = str(detail[0])
    for kind in ("float", "int", "string"):
        if kind in base:
            return kind
    return base
