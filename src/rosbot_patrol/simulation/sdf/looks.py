"""Colours of SDF materials: given directly, or by the name of a script of Gazebo or of a model."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

from rosbot_patrol.simulation.meshes.colours import Rgba
from rosbot_patrol.simulation.scene.scene import Material
from rosbot_patrol.simulation.sdf.files import ModelPath
from rosbot_patrol.simulation.sdf.ogre_scripts import MaterialScripts
from rosbot_patrol.simulation.sdf.values import Place

GREY: Rgba = (0.7, 0.7, 0.7, 1.0)

# Gazebo's own scripts by name (gazebo.material), with their colours.
_PLAIN = {
    "White": (1.0, 1.0, 1.0), "Black": (0.0, 0.0, 0.0), "FlatBlack": (0.1, 0.1, 0.1),
    "Grey": (0.7, 0.7, 0.7), "Gray": (0.7, 0.7, 0.7), "LightGrey": (0.8, 0.8, 0.8), "DarkGrey": (0.175, 0.175, 0.175),
    "DarkGray": (0.175, 0.175, 0.175), "GreyTransparent": (0.5, 0.5, 0.5),
    "Red": (0.95, 0.0, 0.0), "RedBright": (0.87, 0.26, 0.07), "RedTransparent": (0.95, 0.0, 0.0),
    "RedTransparentOverlay": (0.95, 0.0, 0.0), "Green": (0.0, 0.9, 0.0), "GreenTransparent": (0.0, 0.9, 0.0),
    "GreenTransparentOverlay": (0.0, 0.9, 0.0), "LightOn": (0.0, 1.0, 0.0), "LightOff": (1.0, 0.0, 0.0),
    "Blue": (0.0, 0.0, 0.95), "SkyBlue": (0.05, 0.18, 1.0), "BlueTransparent": (0.0, 0.0, 0.95),
    "BlueTransparentOverlay": (0.0, 0.0, 0.95), "BlueLaser": (0.0, 0.0, 0.95), "Indigo": (0.33, 0.0, 0.5),
    "Purple": (0.95, 0.0, 0.95), "DarkMagentaTransparent": (0.4, 0.0, 0.4),
    "Yellow": (0.95, 0.95, 0.0), "DarkYellow": (0.7, 0.7, 0.0), "YellowTransparent": (0.95, 0.95, 0.0),
    "ZincYellow": (0.97, 0.95, 0.21), "Gold": (0.80, 0.65, 0.12),
    "Orange": (1.0, 0.51, 0.05), "OrangeTransparent": (1.0, 0.44, 0.0), "Turquoise": (0.0, 0.95, 0.95),
    "JointAnchor": (1.0, 1.0, 1.0), "PioneerBody": (0.8, 0.0, 0.0), "Pioneer2Body": (0.68, 0.0, 0.0),
    "WhiteGlow": (1.0, 1.0, 1.0), "RedGlow": (1.0, 0.0, 0.0), "GreenGlow": (0.0, 1.0, 0.0),
    "BlueGlow": (0.0, 0.0, 1.0), "YellowGlow": (1.0, 1.0, 0.0), "PurpleGlow": (1.0, 0.0, 1.0),
    "TurquoiseGlow": (0.0, 1.0, 1.0), "TurquoiseGlowOutline": (0.0, 1.0, 1.0),
    "ZincGrey": (0.45, 0.47, 0.50), "Chrome": (0.75, 0.76, 0.78), "Metal": (0.6, 0.61, 0.63),
    "Aluminium": (0.65, 0.66, 0.68),
}  # fmt: skip

# Gazebo's scripts with a picture: its approximate mean colour, and our most similar texture, "" for none.
_PICTURED = {
    "Bricks": ((0.60, 0.33, 0.26), "bricks"), "Wood": ((0.57, 0.41, 0.26), "wood"),
    "WoodFloor": ((0.60, 0.45, 0.30), "wood"), "WoodPallet": ((0.62, 0.50, 0.35), "wood"),
    "WoodTile": ((0.55, 0.40, 0.27), "wood"), "OakFloor": ((0.62, 0.46, 0.29), "wood"),
    "CeilingTiled": ((0.80, 0.79, 0.76), "tiles"), "PaintedWall": ((0.83, 0.80, 0.73), "plaster"),
    "Paper": ((0.92, 0.91, 0.86), ""), "WindowFrame": ((0.75, 0.75, 0.75), ""), "Grass": ((0.24, 0.42, 0.16), "leaves"),
    "GreyGradientSky": ((0.6, 0.62, 0.65), ""), "CloudySky": ((0.6, 0.7, 0.85), ""),
    "CorrugatedSheetMetal": ((0.58, 0.59, 0.60), "stripes"),
    "Asphalt": ((0.25, 0.25, 0.26), "carpet"), "Tarmac": ((0.30, 0.30, 0.31), "carpet"),
    **dict.fromkeys(("Pedestrian", "Footway", "Steps"), ((0.62, 0.60, 0.57), "tiles")),
    **dict.fromkeys(
        ("Road", "Road1", "Residential", "Tertiary", "Motorway", "Lanes_6", "Trunk", "Lanes_4", "Primary", "Lanes_2",
         "Secondary", "Lane_1"), ((0.30, 0.30, 0.31), "carpet"),
    ),
}  # fmt: skip

_UNSEEN = 0.7  # more transparent visuals are left out: the camera here draws everything opaque
_NO_SCRIPT = ("", "__default__")


@dataclass
class Looks:
    """Reader of materials.

    Attributes:
        model_path: search path of the models' scripts.
        skipped: collects the names of unknown scripts.
    """

    model_path: ModelPath
    skipped: set[str]
    _scripts: MaterialScripts = field(default_factory=MaterialScripts)

    def material(self, visual: ET.Element, own: Rgba | None, place: Place) -> Material:
        """Read the material of a <visual>; `own` is the mesh's colour, used if the element names none.

        Raises:
            WorldError: a colour is invalid.
        """
        material = visual.find("material")
        if material is None:
            return Material(rgba=own or GREY)
        written = _written(material, place)
        script = material.find("script")
        name = (script.findtext("name") or script.text or "").strip() if script is not None else ""
        if script is None or name in _NO_SCRIPT:
            return Material(rgba=written or own or GREY)
        short = name.removeprefix("Gazebo/")
        if short in _PICTURED:
            colour, texture = _PICTURED[short]
            return Material(rgba=_tinted((*colour, 1.0), written), texture=texture)
        if short in _PLAIN:
            return Material(rgba=written or (*_PLAIN[short], 1.0))
        found = self._of_model(script, name, place)
        if found is None:
            self.skipped.add(f"the material script '{name}'")
            return Material(rgba=written or own or GREY)
        colour_of_script, is_pictured = found
        if is_pictured:
            return Material(rgba=_tinted(colour_of_script, written))
        return Material(rgba=written or colour_of_script)

    def _of_model(self, script: ET.Element, name: str, place: Place) -> tuple[Rgba, bool] | None:
        own = place.path.parent / "materials" / "scripts"
        places = [own] if own.is_dir() else []
        for uri in script.findall("uri"):
            found = self.model_path.look((uri.text or "").strip(), place.path.parent)
            if found is not None:
                places.append(found)
        return self._scripts.look(name, places)


def is_unseen(visual: ET.Element, place: Place) -> bool:
    """Whether a <visual> is too transparent to draw; raises WorldError if <transparency> is not a number."""
    text = visual.findtext("transparency")
    if text is None or not text.strip():
        return False
    try:
        return float(text) > _UNSEEN
    except ValueError as err:
        raise place.inside("<transparency>").error(f"expected one number, got '{text.strip()}'") from err


def _written(material: ET.Element, place: Place) -> Rgba | None:
    """The colour given in a <material>: emissive first, then diffuse, then ambient."""
    found: dict[str, Rgba] = {}
    for tag in ("diffuse", "ambient", "emissive"):
        text = material.findtext(tag)
        if text and text.strip():
            found[tag] = _colour(text, place.inside(f"<{tag}>"))
    glow = found.pop("emissive", None)
    lit = found.get("diffuse", found.get("ambient"))
    if glow is not None and max(glow[:3]) > max(lit[:3] if lit is not None else (0.0,)):
        return glow
    return lit


def _tinted(picture: Rgba, colour: Rgba | None) -> Rgba:
    """A picture's colour, multiplied by a given colour."""
    if colour is None:
        return picture
    r, g, b = (a * c for a, c in zip(picture[:3], colour[:3], strict=True))
    return (r, g, b, 1.0)


def _colour(text: str, place: Place) -> Rgba:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) not in (3, 4) or not all(math.isfinite(v) and v >= 0.0 for v in values):
        raise place.error(f"expected 3 or 4 numbers, got '{' '.join(text.split())}'")
    r, g, b, a = (min(v, 1.0) for v in [*values, 1.0][:4])
    return (r, g, b, a)
