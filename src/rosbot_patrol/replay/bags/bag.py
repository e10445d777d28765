"""Reader of ROS 1 bags (a file) and ROS 2 bags (a folder), in the order of time, without ROS.

rosbags reads them, by the message definitions in the bag itself. One chunk of the bag is in memory at a time, and some
hundred bytes for each message's place in the file, so that many GB of pictures need little memory.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from rosbags.highlevel import AnyReader
from rosbags.highlevel.anyreader import AnyReaderError, ReaderErrors
from rosbags.interfaces import Connection
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_typestore

from rosbot_patrol.errors import BagError
from rosbot_patrol.replay.bags.definitions import definition_problem, know_headers
from rosbot_patrol.replay.bags.records import ANY, KINDS, Kind
from rosbot_patrol.replay.bags.ros1_reader import LenientReader

# Errors of rosbags and the decompressors for invalid bytes.
BROKEN = (
    AnyReaderError,
    *ReaderErrors,
    SerdeError,
    TypesysError,
    AssertionError,
    LookupError,
    ValueError,
    RuntimeError,
    OSError,
    EOFError,
    struct.error,
    sqlite3.Error,
)
NS = 1e-9


class Record(NamedTuple):
    """One message: recording time [s], topic, and its record (`records.Kind`)."""

    time: float
    topic: str
    content: Any


class Bag:
    """A bag opened for reading; a context manager.

    Args:
        path: path of a ROS 1 bag, or the folder of a ROS 2 one.

    Raises:
        BagError: it does not exist, is no bag, is truncated, lacks its index, or has an unknown compression.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        if not self.path.exists():
            raise BagError(self.path, "there is no such bag")
        if self.path.is_dir() and not (self.path / "metadata.yaml").exists():
            raise BagError(self.path, "is a folder without metadata.yaml, expected a ROS 1 bag or a ROS 2 bag's folder")
        try:
            self._reader = AnyReader([self.path], default_typestore=get_typestore(Stores.ROS2_FOXY))
            if not self._reader.is2:
                self._reader.readers = [LenientReader(self.path)]
            self._reader.open()
            know_headers(self._reader.typestore)
        except BROKEN as err:
            raise BagError(self.path, _open_problem(self.path, err)) from err
        self.done = 0.0  # share of the bag's time that has been read

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        if self._reader.isopen:
            self._reader.close()

    @property
    def start(self) -> float:
        """Recording time of the first message [s], 0 if there is none."""
        return self._reader.start_time * NS if self._reader.message_count else 0.0

    @property
    def duration(self) -> float:
        """Time from the first message to the last [s]."""
        return max(self._reader.duration, 0) * NS if self._reader.message_count else 0.0

    @property
    def topics(self) -> dict[str, str]:
        """The type of each topic, spelled as in ROS 1: sensor_msgs/LaserScan."""
        return {each.topic: ros1_name(each.msgtype) for each in self._reader.connections}

    def counts(self) -> dict[str, int]:
        """Number of messages of each topic."""
        return {topic: info.msgcount for topic, info in self._reader.topics.items()}

    def find(self, topic: str) -> str | None:
        """Find a topic in the bag's spelling, with or without the first slash; None if it does not exist."""
        return next((known for known in self.topics if known.lstrip("/") == topic.lstrip("/")), None)

    def records(self, topics: Iterable[str], kinds: Mapping[str, Kind] = KINDS) -> Iterator[Record]:
        """Read the messages of some topics in the order of their recording.

        Args:
            topics: topics of the bag.
            kinds: conversions of messages, by their types.

        Raises:
            BagError: a topic does not exist or has a type not in `kinds`, its definition lacks a field, or its bytes
            are
                invalid.
        """
        wanted = [each for topic in topics for each in self._connections(topic)]
        if not wanted:
            return
        decoders = {id(each): self._decoder(each, kinds) for each in wanted}
        begin, span = self._reader.start_time, max(self._reader.duration, 1)
        for connection, time, raw in self._messages(wanted):
            self.done = (time - begin) / span
            yield Record(time * NS, connection.topic, self._decoded(decoders[id(connection)], connection, raw))
        self.done = 1.0

    def _connections(self, topic: str) -> list[Connection]:
        found = [each for each in self._reader.connections if each.topic.lstrip("/") == topic.lstrip("/")]
        if not found:
            raise BagError(self.path, f"has no topic '{topic}'; its topics: {', '.join(sorted(self.topics)) or 'none'}")
        return found

    def _messages(self, wanted: Sequence[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        try:
            yield from self._reader.messages(wanted)
        except BROKEN as err:
            raise BagError(self.path, f"is cut short or damaged {self.done:.0%} of the way ({_said(err)})") from err

    def _decoder(self, connection: Connection, kinds: Mapping[str, Kind]) -> Callable[[bytes], Any]:
        name = ros1_name(connection.msgtype)
        kind = kinds.get(connection.msgtype)
        if kind is None:
            raise BagError(self.path, f"topic '{connection.topic}' is {name}, which cannot be used here")
        is_known = kind.md5 == ANY or (connection.digest == kind.md5 and not self._reader.is2)
        if kind.fast is not None and is_known:
            return kind.fast
        problem = definition_problem(self._reader.typestore.fielddefs, connection.msgtype, kind.needed)
        if problem:
            raise BagError(
                self.path,
                f"topic '{connection.topic}', {name}: {problem}; record it anew, or `rosbag fix` brings it up to date",
            )
        deserialize, convert, message_type = self._reader.deserialize, kind.convert, connection.msgtype
        return lambda raw: convert(deserialize(raw, message_type))

    def _decoded(self, decode: Callable[[bytes], Any], connection: Connection, raw: bytes) -> Any:
        try:
            return decode(raw)
        except BROKEN as err:
            name = ros1_name(connection.msgtype)
            problem = f"a message of '{connection.topic}' {self.done:.0%} of the way is no {name} ({_said(err)})"
            raise BagError(self.path, f"{problem}: leave it out by `rosbag filter`") from err


def ros1_name(message_type: str) -> str:
    """Convert sensor_msgs/msg/LaserScan to ROS 1's spelling."""
    return message_type.replace("/msg/", "/")


def _said(err: Exception) -> str:
    text = " ".join(str(each) for each in err.args).strip() or type(err).__name__
    return text.splitlines()[0][:200]


def _open_problem(path: Path, err: Exception) -> str:
    """Reason why a bag cannot be opened, and a remedy."""
    said = _said(err)
    if isinstance(err, TypesysError):
        return f"its message definitions cannot be used ({said}): record it anew or leave out topics by `rosbag filter`"
    if "not indexed" in said:
        return f"has no index, its recording was not ended: `rosbag reindex {path}` makes one"
    if said.startswith("Compression"):
        word = said.split("'")[1] if "'" in said else "?"
        return f"is compressed by '{word}', expected none, bz2 or lz4: `rosbag decompress` it where that is known"
    if "magic" in said or "empty" in said:
        return f"is no bag ({said.rstrip('.')}), expected a ROS 1 bag or a ROS 2 bag's folder"
    if path.is_dir():
        return f"is cut short or damaged ({said.rstrip('.')}): `ros2 bag reindex {path}` may mend it"
    return f"is cut short or damaged ({said.rstrip('.')}): `rosbag reindex {path}` saves what is there"
