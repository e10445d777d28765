"""rosbags' reader of ROS 1 bags, with rosbag's tolerance for topics' connection headers.

rosbags expects a number for `latching` and otherwise gives up the whole bag; rosbag accepts any text. An empty message
definition is replaced by ROS noetic's, if the MD5 sum is equal. rosbags also expects the fields of all index records in
the order of the first one, and the length of a record in its length field; rosbag goes by the number of entries.
"""

from __future__ import annotations

import struct
from functools import cache

from rosbags.interfaces import Connection, ConnectionExtRosbag1
from rosbags.rosbag1.reader import Header, IndexData, Reader, ReaderError, RecordType, normalize
from rosbags.typesys import Stores, TypesysError, get_typestore
from rosbags.typesys.msg import normalize_msgtype

LATCHED = ("1", "true")
_ENTRY = struct.Struct("<III")  # seconds and nanoseconds, offset in the chunk


class LenientReader(Reader):
    """Read the headers of topics and indexes itself, all else as rosbags does."""

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Read the index of one topic in a chunk from the current position into `indexes`; raises ReaderError."""
        if self.bio is None:
            raise ReaderError("The bag is not open.")
        header = Header.read(self.bio, RecordType.IDXDATA)
        version, count = header.get_uint32("ver"), header.get_uint32("count")
        if version != 1:
            raise ReaderError(f"IDXDATA version {version} is not supported.")
        if count * _ENTRY.size > self.path.stat().st_size:
            raise ReaderError("The index of a chunk counts more entries than the bag has room for.")
        data = self.bio.read(4 + count * _ENTRY.size)[4:]
        if len(data) < count * _ENTRY.size:
            raise ReaderError("The index of a chunk ends early.")
        entries = indexes[header.get_uint32("conn")]
        entries.extend(IndexData(s * 10**9 + ns, pos, offset) for s, ns, offset in _ENTRY.iter_unpack(data))

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
