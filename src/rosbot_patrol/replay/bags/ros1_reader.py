"""rosbags' reader of ROS 1 bags, with rosbag's tolerance for topics' connection headers.

rosbags expects a number for `latching` and otherwise gives up the whole bag; rosbag accepts any text. An empty message
definition is replaced by ROS noetic's, if the MD5 sum is equal.
"""

from __future__ import annotations

from functools import cache

from rosbags.interfaces import Connection, ConnectionExtRosbag1
from rosbags.rosbag1.reader import Header, Reader, ReaderError, RecordType, normalize
from rosbags.typesys import Stores, TypesysError, get_typestore
from rosbags.typesys.msg import normalize_msgtype

LATCHED = ("1", "true")


class LenientReader(Reader):
    """Read the topics' headers itself, all else as rosbags does."""

    def read_connection(self) -> Connection:
        """Read a connection record from the current position; raises ReaderError."""
        if self.bio is None:
            raise ReaderError("The bag is not open.")
        record = Header.read(self.bio, RecordType.CONNECTION)
        header = Header.read(self.bio)
        message_type, md5 = normalize_msgtype(header.get_string("type")), header.get_string("md5sum")
        return Connection(
            record.get_uint32("conn"),
            normalize(record.get_string("topic")),
            message_type,
            header.get_string("message_definition") or _definition_of(message_type, md5),
            md5,
            0,
            ConnectionExtRosbag1(_text(header, "callerid"), _latching(header)),
            self,
        )


def _text(header: Header, name: str) -> str | None:
    return header[name].decode(errors="replace") if name in header else None


def _latching(header: Header) -> int | None:
    said = _text(header, "latching")
    return None if said is None else int(said.strip().lower() in LATCHED)


@cache
def _definition_of(message_type: str, md5: str) -> str:
    """Definition of a type in ROS noetic with that MD5 sum, empty if there is none."""
    try:
        definition, found = get_typestore(Stores.ROS1_NOETIC).generate_msgdef(message_type)
    except TypesysError:
        return ""
    return definition if found == md5 else ""
