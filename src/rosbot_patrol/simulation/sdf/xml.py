"""Lenient XML reader for SDF files: like Gazebo's own reader, it accepts more than the standard does.

Accepted: text before the XML declaration, "--" in comments, undeclared prefixes, a bare "&", bytes of Latin-1, control
characters, anything behind the root's end, the root <gazebo> of SDF before 1.4.
Refused with a remedy: unexpanded templates, and poses in the form of SDF 1.0.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.parsers import expat

from rosbot_patrol.errors import WorldError

log = logging.getLogger(__name__)

_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_BARE_AMPERSAND = re.compile(rb"&(?!(?:#\d+|#x[0-9a-fA-F]+|amp|lt|gt|quot|apos);)")
_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]")
_DECLARATION = re.compile(rb"<\?xml\s.*?\?>", re.DOTALL)
_ROOTS = ("sdf", "gazebo")
_OLD_POSES = (("world/", ""), ("world/", "link/"), ("", ""), ("", "link/"))  # of <origin>, in a model and below


def read_sdf(path: Path) -> ET.Element:
    """Read the root of an SDF file.

    Raises:
        WorldError: the file cannot be read, is not XML, a template or not SDF.
    """
    try:
        data = path.read_bytes()
    except OSError as err:
        raise WorldError(path, f"cannot be read: {err.strerror}") from err
    return parse_sdf(data, path)


def parse_sdf(data: bytes, path: Path) -> ET.Element:
    """Parse the text of an SDF file; `path` is its name in messages. Raises WorldError as `read_sdf` does."""
    if b"<xacro:" in data and b"<xacro:" in _COMMENT.sub(b"", data):
        raise WorldError(path, "holds xacro macros, expand it first: rosrun xacro xacro FILE > WORLD")
    try:
        root = ET.fromstring(data)
    except (ET.ParseError, LookupError, ValueError) as err:
        root = _forgiven(path, data, err)
    if root.tag not in _ROOTS:
        raise WorldError(path, f"is no SDF file, its first element is <{root.tag}>")
    if any(root.find(f"{outer}model/{inner}origin[@pose]") is not None for outer, inner in _OLD_POSES):
        version = root.get("version", "1.0")
        raise WorldError(path, f"is of SDF {version}, with poses in <origin>: convert it with 'gz sdf -c' of Gazebo")
    if _number(root.get("version", "")) < (1, 5):
        _turn_axes(root)
    return root


def _forgiven(path: Path, data: bytes, error: Exception) -> ET.Element:
    """The root of XML with faults that Gazebo accepts; otherwise raises with the sentence for the first fault."""
    if re.search(rb"<%[^>]*%>", data):
        raise WorldError(path, "is an ERB template, expand it first: erb FILE > WORLD") from error
    declaration = _DECLARATION.search(data)
    data = _COMMENT.sub(lambda comment: b"\n" * comment[0].count(b"\n"), data)
    if declaration is not None:
        data = declaration[0] + data.replace(declaration[0], b"", 1)
    if b"\x00" not in data:  # with a byte order mark of UTF-16 the patterns below mean nothing
        data = _CONTROL.sub(b" ", _BARE_AMPERSAND.sub(b"&amp;", _as_utf8(data)))
    builder = ET.TreeBuilder()
    open_tags: list[str] = []
    ended = False

    def begin(tag: str, attributes: dict[str, str]) -> None:
        builder.start(tag, attributes)
        open_tags.append(tag)

    def end(tag: str) -> None:
        nonlocal ended
        builder.end(tag)
        open_tags.pop()
        ended = not open_tags

    try:
        parser = expat.ParserCreate()  # without namespaces
        parser.StartElementHandler, parser.EndElementHandler = begin, end
        parser.CharacterDataHandler = builder.data
        try:
            parser.Parse(data, True)
        except expat.ExpatError:
            if not ended:
                raise
        root: ET.Element = builder.close()
    except (expat.ExpatError, LookupError, ValueError, AssertionError):
        raise WorldError(path, f"is not XML, or not all of it: {error}") from error
    log.info("%s: is not quite XML (%s), and is read all the same", path, error)
    return root


def _as_utf8(data: bytes) -> bytes:
    """The same text in UTF-8, where bytes of another encoding stand in a file that names none or UTF-8."""
    try:
        data.decode()
    except UnicodeDecodeError:
        if not re.search(rb"<\?xml[^>]*encoding=['\"](?!utf-8)", data, re.IGNORECASE):
            return data.decode("latin-1").encode()
    return data


def _number(version: str) -> tuple[int, ...]:
    return tuple(int(word) for word in version.split(".") if word.isdigit()) or (1, 7)


def _turn_axes(root: ET.Element) -> None:
    """Mark joint axes as in the model frame, which was the rule before SDF 1.5."""
    for axis in root.iterfind(".//joint/axis"):
        if axis.find("use_parent_model_frame") is None:
            ET.SubElement(axis, "use_parent_model_frame").text = "1"
