"""Pictures in an endless HTTP answer (multipart/x-mixed-replace), as network cameras and the ESP32-CAM send them.

Parts are framed as in RFC 2046, 5.1. Cameras deviate: some have no Content-Length, and some already write the two
dashes of a delimiter into the header's boundary. Both are accepted.
"""

from __future__ import annotations

from email.message import Message

from rosbot_patrol.errors import ProtocolError

_MOST_HEADER = 8192
MOST_PART = 16 << 20  # bytes of one picture


def boundary_of(content_type: str) -> str:
    """Boundary that a Content-Type names. Raises ProtocolError if it names none."""
    message = Message()
    message["Content-Type"] = content_type
    boundary = message.get_param("boundary")
    if not isinstance(boundary, str) or not boundary:
        raise ProtocolError("", f"the answer's type is '{content_type}', without a boundary between its pictures")
    return boundary


class PartReader:
    """Cut a stream into its parts.

    Args:
        boundary: as the Content-Type names it.
        most: bytes that a part may have.
    """

    def __init__(self, boundary: str, most: int = MOST_PART) -> None:
        self._delimiter = b"--" + boundary.removeprefix("--").encode("latin-1", "replace")
        self._most = most
        self._buffer = bytearray()
        self._searched = 0  # bytes of the buffer that hold no delimiter
        self._length: int | None = None  # of the part under way, where its header names it
        self._is_in_part = False

    def feed(self, data: bytes) -> list[bytes]:
        """Bodies of the parts that these bytes complete. Raises ProtocolError for what is no such stream."""
        self._buffer += data
        done: list[bytes] = []
        while True:
            if not self._is_in_part:
                if not self._take_header():
                    return done
                continue
            body = self._take_body()
            if body is None:
                return done
            if body:
                done.append(body)

    def _take_header(self) -> bool:
        """Go to the first byte of the next part; returns False if it has not come yet."""
        start = self._buffer.find(self._delimiter)
        if start < 0:
            del self._buffer[: max(len(self._buffer) - len(self._delimiter), 0)]
            return False
        end, skip = self._end_of_header(start)
        if end < 0:
            if len(self._buffer) - start > _MOST_HEADER:
                raise ProtocolError("", f"the header of a picture is longer than {_MOST_HEADER} bytes")
            return False
        self._length = _length_of(bytes(self._buffer[start:end]))
        if self._length is not None and self._length > self._most:
            raise ProtocolError("", f"a picture of {self._length} bytes is announced; at most {self._most} are taken")
        del self._buffer[: end + skip]
        self._searched = 0
        self._is_in_part = True
        return True

    def _end_of_header(self, start: int) -> tuple[int, int]:
        ends = [(self._buffer.find(mark, start), len(mark)) for mark in (b"\r\n\r\n", b"\n\n")]
        return min((each for each in ends if each[0] >= 0), default=(-1, 0))

    def _take_body(self) -> bytes | None:
        if self._length is not None:
            if len(self._buffer) < self._length:
                return None
            body = bytes(self._buffer[: self._length])
            del self._buffer[: self._length]
        else:
            end = self._buffer.find(self._delimiter, max(self._searched - len(self._delimiter), 0))
            if end < 0:
                self._searched = len(self._buffer)
                if self._searched > self._most:
                    raise ProtocolError("", f"a picture of more than {self._most} bytes has no end")
                return None
            body = bytes(self._buffer[:end]).removesuffix(b"\n").removesuffix(b"\r")
            del self._buffer[:end]
        self._is_in_part = False
        return body


def _length_of(header: bytes) -> int | None:
    for line in header.splitlines()[1:]:
        name, _, value = line.partition(b":")
        if name.strip().lower() == b"content-length":
            text = value.strip().decode("latin-1")
            if not (text.isascii() and text.isdigit()) or len(text) > 12:
                raise ProtocolError("", f"the length of a picture is '{text}', not a number")
            return int(text)
    return None
