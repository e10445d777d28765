"""Lenient XML reader for SDF files: like Gazebo's own reader, it accepts more than the standard does.

Accepted: text before the XML declaration, "--" in comments, undeclared prefixes, the root <gazebo> of SDF before 1.4.
Refused with a remedy: unexpanded templates, and poses in the form of SDF 1.0.
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.parsers import expat

from rosbot_patrol.errors import WorldError

_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
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
    builder = ET.TreeBuilder()
    try:
        parser = expat.ParserCreate()  # without namespaces
        parser.StartElementHandler = builder.start
        parser.EndElementHandler = builder.end
        parser.CharacterDataHandler = builder.data
        parser.Parse(data, True)
        root: ET.Element = builder.close()
    except (expat.ExpatError, LookupError, ValueError, AssertionError):
        raise WorldError(path, f"is not XML, or not all of it: {error}") from error
    return root


def _number(version: str) -> tuple[int, ...]:
    return tuple(int(word) for word in version.split(".") if word.isdigit()) or (1, 7)


def _turn_axes(root: ET.Element) -> None:
    """Mark joint axes as in the model frame, which was the rule before SDF 1.5."""
    for axis in root.iterfind(".//joint/axis"):
        if axis.find("use_parent_model_frame") is None:
            ET.SubElement(axis, "use_parent_model_frame").text = "1"
