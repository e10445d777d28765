"""A figure's skins as visuals of a body: joined by joint and material, with partners that count the visuals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rosbot_patrol.simulation.actors.figure.surface import Skin
from rosbot_patrol.simulation.actors.figure.wardrobe import WHITE
from rosbot_patrol.simulation.scene.scene import Material, Shape


@dataclass(frozen=True)
class Part:
    """A joint and what moves with it."""

    joint: str
    shape: Shape
    material: Material


def assemble(skins: list[tuple[Skin, Material]]) -> tuple[Part, ...]:
    """Make the parts of a figure; each skin's partners must be joints of other skins."""
    merged = _merged(skins)
    first: dict[str, int] = {}
    for index, (s, _) in enumerate(merged):
        first.setdefault(s.joint, index)
    parts = (Part(s.joint, _linked(s, first), material) for s, material in merged)
    return tuple(_balanced(part) if part.material.rgba[:3] == WHITE else part for part in parts)


def _merged(placed: list[tuple[Skin, Material]]) -> list[tuple[Skin, Material]]:
    """Join the skins of one joint and material, so that a person has few visuals."""
    groups: dict[tuple[str, Material], list[Skin]] = {}
    for s, material in placed:
        groups.setdefault((s.joint, material), []).append(s)
    return [(_joined(skins), material) for (_, material), skins in groups.items()]


def _joined(skins: list[Skin]) -> Skin:
    names = tuple(dict.fromkeys(name for s in skins for name in s.partners))
    vertices, faces, details, count = [], [], [], 0
    for s in skins:
        shape, detail = s.shape, s.shape.detail
        assert shape.vertices is not None
        assert shape.faces is not None
        assert detail is not None
        table = np.array([*(names.index(name) for name in s.partners), -1])
        vertices.append(shape.vertices)
        faces.append(shape.faces + count)
        details.append(replace(detail, partners=table[detail.partners]))
        count += len(shape.vertices)
    whole = {name: np.concatenate([getattr(d, name) for d in details]) for name in vars(details[0])}
    joined = replace(details[0], **whole)
    shape = Shape(kind="mesh", vertices=np.concatenate(vertices), faces=np.concatenate(faces), detail=joined)
    return Skin(skins[0].joint, shape, names)


def _linked(s: Skin, first: dict[str, int]) -> Shape:
    """The shape with partners that count the body's visuals."""
    detail = s.shape.detail
    assert detail is not None
    table = np.array([*(first[name] for name in s.partners), -1])
    return replace(s.shape, detail=replace(detail, partners=table[detail.partners]))


def _balanced(part: Part) -> Part:
    """A part of absolute colours with their mean as the material's, for renderers without colours of vertices."""
    detail = part.shape.detail
    assert detail is not None
    mean = np.maximum(detail.colours.mean(axis=0), 1e-3)
    red, green, blue = (float(v) for v in mean * part.material.rgba[:3])
    shape = replace(part.shape, detail=replace(detail, colours=detail.colours / mean))
    return replace(part, shape=shape, material=replace(part.material, rgba=(red, green, blue, 1.0)))
