"""Worlds from plans: walls with doors and windows, a floor and furniture, as SDF 1.6 for Gazebo classic.

A plan is the content of a yaml file. The head of config/flat_plan.yaml explains the format.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from rosbot_patrol.files import write_atomic

Numbers = Sequence[float]
Boxes = dict[str, list[tuple[Numbers, Numbers]]]
"""Boxes of each wall: pose (x, y, z, roll, pitch, yaw) and size [m, rad]."""

WALL_COLOUR = (0.88, 0.86, 0.80)
LINTEL_COLOUR = (0.70, 0.60, 0.48)
FLOOR_COLOUR = (0.55, 0.43, 0.31)
_HANGS = 0.5  # a part of a wall that begins above this height is over an opening [m]


def write_world(plan: Mapping[str, Any], output: Path, *, head: str, walls: Boxes | None = None) -> tuple[int, int]:
    """Write a plan's world; meshes of its turned pieces go to `meshes` beside it.

    Args:
        plan: the plan.
        output: the world's file.
        head: a comment for it.
        walls: boxes of the walls; by default made from the plan's `walls`.

    Returns:
        Number of the walls' boxes, and of pieces of furniture.
    """
    sdf = ET.Element("sdf", version="1.6")
    world = ET.SubElement(sdf, "world", name=plan["name"])
    _text(world, "gravity", "0 0 -9.8")
    sun = ET.SubElement(world, "light", name="sun", type="directional")
    _text(sun, "cast_shadows", "1")
    _text(sun, "pose", f"0 0 10 0 {math.pi / 6:.4f} 0")
    _text(sun, "diffuse", "0.8 0.8 0.8 1")
    _text(sun, "direction", "-0.5 0.1 -0.9")
    _add_floor(world, plan.get("floor_colour", FLOOR_COLOUR), plan.get("floor_material", ""))
    links = wall_boxes(plan) if walls is None else walls
    look = (plan.get("wall_colour", WALL_COLOUR), plan.get("wall_material", ""))
    boxes = _add_walls(world, plan["name"], links, *look)
    pieces = _add_furniture(world, plan, output.parent)
    ET.indent(sdf)
    text = f"<?xml version='1.0'?>\n<!-- {head} -->\n{ET.tostring(sdf, encoding='unicode')}\n"
    write_atomic(output, text.encode())
    return boxes, pieces


def wall_boxes(plan: Mapping[str, Any]) -> Boxes:
    """Boxes of a plan's walls: each wall in pieces beside, above and below its openings."""
    links: Boxes = {}
    for wall in plan["walls"]:
        (x0, y0), (x1, y1) = wall["from"], wall["to"]
        length, yaw = math.hypot(x1 - x0, y1 - y0), math.atan2(y1 - y0, x1 - x0)
        thickness, height = wall.get("thickness", plan["thickness"]), wall.get("height", plan["height"])
        pieces, begin = [], -thickness / 2  # half a thickness more closes the corners
        for opening in sorted(wall.get("openings", []), key=lambda o: float(o["at"])):
            left, right = opening["at"] - opening["width"] / 2, opening["at"] + opening["width"] / 2
            pieces += [(begin, left, 0, height), (left, right, 0, opening.get("sill", 0))]
            pieces.append((left, right, opening.get("head", plan["head"]), height))
            begin = right
        pieces.append((begin, length + thickness / 2, 0, height))
        for a, b, low, high in pieces:
            if b - a > 1e-6 and high - low > 1e-6:
                along = (a + b) / 2
                pose = (x0 + along * math.cos(yaw), y0 + along * math.sin(yaw), (low + high) / 2, 0, 0, yaw)
                links.setdefault(f"Wall_{wall['name']}", []).append((pose, (b - a, thickness, high - low)))
    return links


def _text(parent: ET.Element, tag: str, value: str) -> None:
    ET.SubElement(parent, tag).text = value


def _numbers(values: Numbers) -> str:
    return " ".join(f"{round(v, 6):g}" for v in values)


def _material(visual: ET.Element, colour: Numbers, script: str = "") -> None:
    """A colour; it tints the picture of one of Gazebo's material scripts, if one is named."""
    material = ET.SubElement(visual, "material")
    if script:
        _text(ET.SubElement(material, "script"), "name", f"Gazebo/{script}")
    _text(material, "ambient", _numbers((*colour, 1)))
    _text(material, "diffuse", _numbers((*colour, 1)))


Look = tuple[Numbers, str]
"""A colour, and the name of one of Gazebo's material scripts, "" for none."""


def _add_shape(link: ET.Element, name: str, shape: tuple[str, Any], pose: Numbers, look: Look) -> None:
    """Add a collision and a visual of one primitive and its size, or of a mesh and its file."""
    kind, size = shape
    for role in ("collision", "visual"):
        part = ET.SubElement(link, role, name=f"{name}_{role}")
        _text(part, "pose", _numbers(pose))
        primitive = ET.SubElement(ET.SubElement(part, "geometry"), kind)
        if kind == "mesh":
            _text(primitive, "uri", size)
        elif kind == "box":
            _text(primitive, "size", _numbers(size))
        else:
            _text(primitive, "radius", _numbers(size[:1]))
        if kind == "cylinder":
            _text(primitive, "length", _numbers(size[1:]))
        if role == "visual":
            _material(part, *look)


def _static_model(world: ET.Element, name: str, pose: Numbers | None = None) -> ET.Element:
    model = ET.SubElement(world, "model", name=name)
    _text(model, "static", "1")
    if pose is not None:
        _text(model, "pose", _numbers(pose))
    return model


def _add_floor(world: ET.Element, colour: Numbers, script: str) -> None:
    link = ET.SubElement(_static_model(world, "ground_plane"), "link", name="link")
    for kind in ("collision", "visual"):
        part = ET.SubElement(link, kind, name=kind)
        plane = ET.SubElement(ET.SubElement(part, "geometry"), "plane")
        _text(plane, "normal", "0 0 1")
        _text(plane, "size", "100 100")
        if kind == "visual":
            _material(part, colour, script)


def _add_walls(world: ET.Element, name: str, links: Boxes, colour: Numbers, script: str) -> int:
    """Add a model of the walls: one link per wall."""
    house = _static_model(world, name)
    for wall, parts in links.items():
        link = ET.SubElement(house, "link", name=wall)
        for i, (pose, size) in enumerate(parts):
            hangs = pose[2] - size[2] / 2 > _HANGS
            part = wall if len(parts) == 1 else f"{wall}_{i}"
            _add_shape(link, part, ("box", size), pose, (LINTEL_COLOUR, "") if hangs else (colour, script))
    return sum(len(p) for p in links.values())


def _add_furniture(world: ET.Element, plan: Mapping[str, Any], folder: Path) -> int:
    """Add one static model per piece; the meshes of turned parts go to `folder`/meshes."""
    for item in plan["furniture"]:
        x, y, yaw = item["pose"]
        model = _static_model(world, item["name"], (x, y, 0, 0, 0, yaw))
        link = ET.SubElement(model, "link", name="link")
        for i, part in enumerate(plan["pieces"][item["piece"]]["parts"]):
            pose = (*part["at"], 0, 0, part.get("yaw", 0))
            look = (part["colour"], part.get("material", ""))
            if part["shape"] == "turned":
                file = _write_turned(folder, f"{item['piece']}_{i}", part)
                _add_shape(link, f"part_{i}", ("mesh", file), pose, look)
            else:
                _add_shape(link, f"part_{i}", (part["shape"], part["size"]), pose, look)
    return len(plan["furniture"])


def _write_turned(folder: Path, name: str, part: Mapping[str, Any], sides: int = 24) -> str:
    """Write a mesh of a closed profile (radius, height) rotated about z between two angles; returns its uri."""
    first, last = part.get("angles", (0, 2 * math.pi))
    whole = last - first > 2 * math.pi - 1e-6
    profile, rings = part["profile"], sides if whole else sides + 1
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(profile, profile[1:] + profile[:1], strict=True))
    profile = profile[::-1] if area > 0 else profile  # so that the faces point outwards
    lines = ["# Made by scripts/make_house_world"]
    for k in range(rings):
        angle = first + (last - first) * k / sides
        lines += [f"v {r * math.cos(angle):.4f} {r * math.sin(angle):.4f} {z:.4f}" for r, z in profile]
    count = len(profile)
    for k in range(sides):
        here, there = k * count + 1, (k + 1) % rings * count + 1
        for i in range(count):
            j = (i + 1) % count
            lines.append(f"f {here + i} {here + j} {there + j} {there + i}")
    if not whole:
        lines.append("f " + " ".join(str(i) for i in range(count, 0, -1)))
        lines.append("f " + " ".join(str((rings - 1) * count + i) for i in range(1, count + 1)))
    write_atomic(folder / "meshes" / f"{name}.obj", ("\n".join(lines) + "\n").encode())
    return f"meshes/{name}.obj"
