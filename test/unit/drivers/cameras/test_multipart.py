"""Pictures of an endless HTTP answer, cut anywhere."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbot_patrol.drivers.cameras.multipart import PartReader, boundary_of
from rosbot_patrol.errors import ProtocolError

BODIES = [b"\xff\xd8one\xff\xd9", b"\xff\xd8\r\n\r\ntwo\n\xff\xd9", b"\xff\xd8" + bytes(range(256)) + b"\xff\xd9"]


def stream(*, lengths: bool, end: bytes = b"\r\n", dashes: bytes = b"--") -> bytes:
    parts = b""
    for body in BODIES:
        parts += dashes + b"cut" + end + b"Content-Type: image/jpeg" + end
        parts += (b"content-LENGTH: %d" % len(body) + end if lengths else b"") + end + body + end
    return parts + dashes + b"cut"


@pytest.mark.parametrize("lengths", [True, False])
@given(cuts=st.lists(st.integers(0, 600), max_size=12))
def test_parts_come_whole_however_the_stream_is_cut(lengths: bool, cuts: list[int]) -> None:
    data, reader, found = b"preamble" + stream(lengths=lengths), PartReader("cut"), []
    marks = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    for begin, end in itertools.pairwise(marks):
        found += reader.feed(data[begin:end])
    assert found == BODIES


@pytest.mark.parametrize("lengths", [True, False])
def test_parts_come_whole_byte_by_byte(lengths: bool) -> None:
    reader = PartReader("cut")
    assert [body for byte in stream(lengths=lengths) for body in reader.feed(bytes([byte]))] == BODIES


def test_cameras_that_deviate_are_understood() -> None:
    assert PartReader("--cut").feed(stream(lengths=True)) == BODIES  # the dashes are part of the boundary already
    assert PartReader("cut").feed(stream(lengths=True, end=b"\n")) == BODIES


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (b"--cut\r\nContent-Length: many\r\n\r\n", "the length of a picture is 'many'"),
        (b"--cut\r\nContent-Length: 999999\r\n\r\n", "a picture of 999999 bytes is announced; at most 1000 are taken"),
        (b"--cut\r\n\r\n" + bytes(2000), "a picture of more than 1000 bytes has no end"),
        (b"--cut\r\n" + b"x" * 9000, "the header of a picture is longer than 8192 bytes"),
    ],
)
def test_what_is_no_such_stream_is_named(data: bytes, what: str) -> None:
    with pytest.raises(ProtocolError, match=what):
        PartReader("cut", most=1000).feed(data)


@given(st.lists(st.binary(max_size=64), max_size=20))
def test_garbage_yields_parts_or_a_sentence(pieces: list[bytes]) -> None:
    reader = PartReader("cut", most=200)
    try:
        for piece in pieces:
            reader.feed(piece + b"--cut\r\n")
    except ProtocolError as err:
        assert "picture" in str(err)  # noqa: PT017 - either is right


def test_the_boundary_of_a_type() -> None:
    assert boundary_of('multipart/x-mixed-replace; boundary="a b"') == "a b"
    with pytest.raises(ProtocolError, match="without a boundary"):
        boundary_of("multipart/x-mixed-replace")
