"""Reading bags: order, records, and a sentence for each that cannot be read."""

from __future__ import annotations

import math
import re
import struct
from pathlib import Path

import made_bag
import numpy as np
import pytest
import rosbags.rosbag1.writer
from made_bag import Maker, write_bag
from rosbags.rosbag1 import Writer
from rosbags.rosbag1.writer import Header as WriterHeader

from rosbot_patrol.errors import BagError
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.grid import Grid, GridInfo
from rosbot_patrol.replay.bags import records
from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.bags.raw_ros1 import read_scan, read_transforms
from rosbot_patrol.replay.nodes import patrol_records
from rosbot_patrol.scan import LaserScan

BEGIN = 1_600_000_000.0
GRID = Grid(
    GridInfo(resolution=0.05, width=3, height=2, origin_x=-1.0, origin_y=2.0), np.array([[0, 100, -1], [0, 0, 50]])
)


def scan_at(stamp: float, *, ranges: tuple[float, ...] = (1.0, 2.0, math.nan, math.inf)) -> LaserScan:
    return LaserScan(
        stamp=stamp,
        frame_id="laser",
        angle_min=-0.5,
        angle_increment=0.25,
        range_min=0.125,
        range_max=8.0,
        ranges=np.array(ranges),
    )


def some_messages(*, is2: bool = False, count: int = 5) -> list[tuple[float, str, object]]:
    maker, found = Maker(is2=is2), []
    for i in range(count):
        now = BEGIN + 0.5 * i
        found.append((now, "/scan", maker.scan(scan_at(now))))
        found.append((now + 0.1, "/tf", maker.tf(maker.planar("odom", "base_link", now, Pose2D(float(i), 0.0, 0.5)))))
    found.append((BEGIN + 0.05, "/map", maker.map(GRID)))
    found.append((BEGIN + 0.15, "/initialpose", maker.initial_pose(BEGIN, Pose2D(1.0, 2.0, 3.0))))
    return sorted(found, key=lambda each: each[0])


def read(path: Path, *topics: str) -> list[records.Any]:
    with Bag(path) as bag:
        return list(bag.records(topics))


@pytest.mark.parametrize(("is2", "compression"), [(False, ""), (False, "BZ2"), (False, "LZ4"), (True, "")])
def test_messages_come_in_the_order_of_time_as_plain_records(tmp_path: Path, is2: bool, compression: str) -> None:
    path = write_bag(tmp_path / "made.bag", some_messages(is2=is2), is2=is2, compression=compression)
    found = read(path, "/tf", "scan", "/map", "/initialpose")
    times = [each.time for each in found]
    assert times == sorted(times)
    assert [each.topic for each in found][:5] == ["/scan", "/map", "/tf", "/initialpose", "/scan"]
    scan, grid, edges, pose = (each.content for each in found[:4])
    assert (scan.stamp, scan.frame_id, scan.angle_min, scan.angle_increment) == (BEGIN, "laser", -0.5, 0.25)
    assert scan.ranges.dtype == np.float64
    assert scan.ranges == pytest.approx([1.0, 2.0, math.nan, math.inf], nan_ok=True)
    assert grid.frame == "map"
    assert grid.grid.cells.tolist() == GRID.cells.tolist()
    assert (grid.grid.info.origin_x, grid.grid.info.origin_y) == (-1.0, 2.0)
    assert edges[0][:4] == ("odom", "base_link", BEGIN, 0.0)
    assert pose.pose == pytest.approx((1.0, 2.0, 3.0))
    assert pose.covariance[5, 5] == 0.01


def test_only_the_chosen_topics_are_read_and_the_share_that_is_done_is_told(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "made.bag", some_messages())
    with Bag(path) as bag:
        assert bag.topics["/scan"] == "sensor_msgs/LaserScan"
        assert bag.counts() == {"/scan": 5, "/tf": 5, "/map": 1, "/initialpose": 1}
        assert (bag.start, bag.duration) == (pytest.approx(BEGIN), pytest.approx(2.1, abs=1e-6))
        shares = [bag.done for _ in bag.records(["/tf"])]
        assert bag.done == 1.0
    assert shares == pytest.approx([0.1 / 2.1, 0.6 / 2.1, 1.1 / 2.1, 1.6 / 2.1, 1.0])


def test_fast_parsers_give_what_rosbags_gives() -> None:
    maker, rng = Maker(), np.random.default_rng(1)
    ranges = rng.uniform(0.0, 10.0, 37)
    ranges[[3, 9]] = np.nan, np.inf
    message = maker.scan(scan_at(BEGIN + 0.123456789, ranges=tuple(ranges)))
    raw = maker.bytes(message)
    fast, slow = read_scan(raw), records.scan_of(maker.store.deserialize_ros1(raw, made_bag.SCAN))
    np.testing.assert_array_equal(fast.ranges, slow.ranges)
    for name in ("stamp", "frame_id", "angle_min", "angle_increment", "range_min", "range_max"):
        assert getattr(fast, name) == getattr(slow, name), name
    transforms = [
        maker.transform(f"/parent_{i}", f"child{'é' * i}", BEGIN + i / 7.0, rng.normal(size=3), rng.normal(size=4))
        for i in range(4)
    ]
    raw = maker.bytes(maker.tf(*transforms))
    assert read_transforms(raw) == records.edges_of(maker.store.deserialize_ros1(raw, made_bag.TF))
    with pytest.raises(struct.error):
        read_transforms(raw[:-4])


def test_a_map_or_pose_that_makes_no_sense_is_refused_and_reading_goes_on(tmp_path: Path) -> None:
    maker = Maker()
    grid = maker.map(GRID)
    grid.info.width = 7
    pose = maker.initial_pose(BEGIN, Pose2D())
    pose.pose.pose.orientation.w = math.nan
    path = write_bag(tmp_path / "made.bag", [(BEGIN, "/map", grid), (BEGIN + 1.0, "/initialpose", pose)])
    first, second = (each.content for each in read(path, "/map", "/initialpose"))
    assert first == records.Refused("it has 6 cells, expected 7 x 2")
    assert "is no orientation" in second.problem


def test_orientations_of_zeros_are_a_heading_of_0(tmp_path: Path) -> None:
    maker = Maker()
    grid, pose = maker.map(GRID), maker.initial_pose(BEGIN, Pose2D(1.0, 2.0))
    grid.info.origin.orientation.w = pose.pose.pose.orientation.w = 0.0
    path = write_bag(tmp_path / "made.bag", [(BEGIN, "/map", grid), (BEGIN + 1.0, "/initialpose", pose)])
    first, second = (each.content for each in read(path, "/map", "/initialpose"))
    assert (first.grid.info.origin_x, first.grid.info.yaw) == (GRID.info.origin_x, 0.0)
    assert second.pose == Pose2D(1.0, 2.0)


def refused(path: Path, *topics: str) -> str:
    with pytest.raises(BagError) as caught:
        read(path, *(topics or ("/scan",)))
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert "\n" not in text
    return text


def test_a_bag_that_is_not_there_or_none_at_all(tmp_path: Path) -> None:
    assert "there is no such bag" in refused(tmp_path / "none.bag")
    assert "folder without metadata.yaml" in refused(tmp_path)
    (tmp_path / "text.bag").write_text("hello\n")
    assert "is no bag" in refused(tmp_path / "text.bag")
    (tmp_path / "empty.bag").write_bytes(b"")
    assert "is no bag" in refused(tmp_path / "empty.bag")


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.9, 0.995])
def test_a_bag_cut_short(tmp_path: Path, share: float) -> None:
    path = write_bag(tmp_path / "made.bag", some_messages(count=50))
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    text = refused(path)
    assert "is cut short or damaged" in text
    assert f"rosbag reindex {path}" in text


def test_a_bag_without_index(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "made.bag", some_messages())
    data = path.read_bytes()
    at = data.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(data[:at] + bytes(8) + data[at + 8 :])
    assert f"has no index, its recording was not ended: `rosbag reindex {path}`" in refused(path)


def test_an_unknown_compression(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "made.bag", some_messages(), compression="LZ4")
    path.write_bytes(path.read_bytes().replace(b"compression=lz4", b"compression=zst"))
    assert "is compressed by 'zst', expected none, bz2 or lz4" in refused(path)


def test_a_missing_topic_names_those_that_are_there(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "made.bag", some_messages())
    text = refused(path, "/front_scan")
    assert "has no topic '/front_scan'; its topics: /initialpose, /map, /scan, /tf" in text


def test_a_definition_without_a_field_that_is_needed(tmp_path: Path) -> None:
    path = tmp_path / "made.bag"
    with Writer(path) as writer:
        connection = writer.add_connection(
            "/scan",
            made_bag.SCAN,
            msgdef="std_msgs/Header header\nfloat32 angle_min\n" + "=" * 80 + "\nMSG: std_msgs/Header\n"
            "uint32 seq\ntime stamp\nstring frame_id\n",
            md5sum="0" * 32,
        )
        writer.write(connection, 10**9, bytes(20))
    text = refused(path)
    assert "topic '/scan', sensor_msgs/LaserScan: its definition has no field 'angle_increment'" in text


def test_a_definition_with_a_field_of_another_type(tmp_path: Path) -> None:
    path = tmp_path / "made.bag"
    with Writer(path) as writer:
        connection = writer.add_connection(
            "/tf",
            made_bag.TF,
            msgdef="geometry_msgs/Twist[] transforms\n" + "=" * 80 + "\nMSG: geometry_msgs/Twist\nfloat64 header\n",
            md5sum="1" * 32,
        )
        writer.write(connection, 10**9, bytes(4))
    assert "has no field 'transforms[].header.stamp.sec'" in refused(path, "/tf")


def test_another_definition_that_has_all_fields_is_read(tmp_path: Path) -> None:
    path = tmp_path / "made.bag"
    maker = Maker()
    definition, _ = maker.store.generate_msgdef(made_bag.SCAN, ros_version=1)
    changed = definition.replace("float32[] intensities\n", "float32[] intensities\nuint8 quality\n", 1)
    assert changed != definition
    with Writer(path) as writer:
        connection = writer.add_connection("/scan", made_bag.SCAN, msgdef=changed, md5sum="2" * 32)
        writer.write(connection, 10**9, maker.bytes(maker.scan(scan_at(1.0))) + b"\x07")
    assert read(path, "/scan")[0].content.ranges == pytest.approx([1.0, 2.0, math.nan, math.inf], nan_ok=True)


def test_a_second_plain_header_is_that_of_std_msgs(tmp_path: Path) -> None:
    """As in darknet_ros_msgs/BoundingBoxes, recorded by rosbag itself."""
    path = tmp_path / "made.bag"
    with Writer(path) as writer:
        connection = writer.add_connection(
            "/darknet_ros/bounding_boxes",
            "darknet_ros_msgs/msg/BoundingBoxes",
            msgdef="Header header\nHeader image_header\nBoundingBox[] bounding_boxes\n"
            + "=" * 80
            + "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
            + "=" * 80
            + "\nMSG: darknet_ros_msgs/BoundingBox\nfloat64 probability\nint64 xmin\nint64 ymin\nint64 xmax\n"
            "int64 ymax\nint16 id\nstring Class\n",
            md5sum="3" * 32,
        )
        header = struct.pack("<IIII", 1, 5, 10**8, 0)
        writer.write(connection, 10**9, header + struct.pack("<IIII", 1, 4, 9 * 10**8, 0) + bytes(4))
    with Bag(path) as bag:
        (record,) = bag.records(["/darknet_ros/bounding_boxes"], patrol_records.KINDS)
    assert record.content.stamp == pytest.approx(4.9)


def test_a_message_that_is_shorter_than_it_says(tmp_path: Path) -> None:
    path = tmp_path / "made.bag"
    maker = Maker()
    with Writer(path) as writer:
        connection = writer.add_connection("/scan", made_bag.SCAN, typestore=maker.store)
        writer.write(connection, 10**9, maker.bytes(maker.scan(scan_at(1.0)))[:-9])
    text = refused(path)
    assert re.search(r"a message of '/scan' .* is no sensor_msgs/LaserScan", text)


# -- headers of topics that rosbag takes

OTHER_TOPIC = "std_msgs/msg/String"


def bag_with_header(path: Path, **changes: bytes | None) -> Path:
    """A bag of one scan and one text whose topics' headers have other fields; None: without that field."""
    maker = Maker()
    text = maker.new(OTHER_TOPIC, "hello")
    messages = [(BEGIN, "/scan", maker.scan(scan_at(BEGIN))), (BEGIN + 1.0, "/said", text)]
    with pytest.MonkeyPatch.context() as patch:
        fields = {name: value for name, value in changes.items() if value is not None}

        class Changed(WriterHeader):
            def write(self, dst, opcode=None):
                if "message_definition" in self:
                    for name in changes:
                        self.pop(name, None)
                    self.update(fields)
                return super().write(dst, opcode)

        patch.setattr(rosbags.rosbag1.writer, "Header", Changed)
        return write_bag(path, messages)


@pytest.mark.parametrize("latching", [b"", b"True", b"true", b"False", b"0", b"1", b"2", b"yes", b" 1 ", b"\xff", None])
def test_any_text_for_latching_is_taken(tmp_path: Path, latching: bytes | None) -> None:
    path = bag_with_header(tmp_path / "made.bag", latching=latching)
    (found,) = read(path, "/scan")
    assert found.content.frame_id == "laser"
    with Bag(path) as bag:
        told = {each.ext.latching for each in bag._reader.connections}
    assert told == {None if latching is None else int(latching.strip() in (b"1", b"True", b"true"))}


@pytest.mark.parametrize("callerid", [None, b"", b"/play", b"/k\xfcche"])
def test_a_sender_without_a_name_is_taken(tmp_path: Path, callerid: bytes | None) -> None:
    assert len(read(bag_with_header(tmp_path / "made.bag", callerid=callerid), "/scan")) == 1


def test_an_empty_definition_is_that_of_noetic_where_the_sum_is(tmp_path: Path) -> None:
    path = bag_with_header(tmp_path / "made.bag", message_definition=b"")
    (found,) = read(path, "/scan")
    np.testing.assert_array_equal(found.content.ranges, [1.0, 2.0, np.nan, np.inf])
    with Bag(path) as bag:
        (said,) = [each for each in bag._reader.connections if each.topic == "/said"]
        assert said.msgdef.startswith("string data")
    other = bag_with_header(tmp_path / "other.bag", message_definition=b"", md5sum=b"0" * 32)
    with Bag(other) as bag:
        assert {each.msgdef for each in bag._reader.connections} == {""}


# -- index records that rosbag takes


def index_headers(data: bytes) -> list[int]:
    """Places of the headers of index records: of connection, number of entries and version."""
    return [
        found.start()
        for found in re.finditer(rb"\x2f\x00\x00\x00(?=.{47})", data, re.DOTALL)
        if b"conn=" in data[found.start() : found.start() + 51]
    ]


@pytest.mark.parametrize("damage", ["another order", "a wrong length"])
def test_an_index_is_read_as_rosbag_reads_it(tmp_path: Path, damage: str) -> None:
    maker = Maker()
    text = maker.new(OTHER_TOPIC, "hello")
    scans = [(BEGIN + k, "/scan", maker.scan(scan_at(BEGIN + k))) for k in range(3)]
    path = write_bag(tmp_path / "made.bag", [*scans, (BEGIN + 5.0, "/said", text)])
    data = bytearray(path.read_bytes())
    first, second = index_headers(data)
    for place in (second,) if damage == "another order" else (first, second):
        fields, at = [], place + 4
        while at < place + 51:
            (size,) = struct.unpack_from("<I", data, at)
            fields.append(bytes(data[at : at + 4 + size]))
            at += 4 + size
        if damage == "another order":
            data[place + 4 : place + 51] = b"".join(reversed(fields))
        else:
            data[place + 51 : place + 55] = bytes(4)
    path.write_bytes(bytes(data))
    assert len(read(path, "/scan")) == 3


def test_an_index_that_ends_early_is_a_sentence(tmp_path: Path) -> None:
    path = write_bag(tmp_path / "made.bag", some_messages())
    data = bytearray(path.read_bytes())
    place = index_headers(data)[0]
    at = data.index(b"count=", place) + 6
    data[at : at + 4] = b"\xff\xff\xff\x0f"
    path.write_bytes(bytes(data))
    assert "made.bag" in refused(path)
