"""Colours of SDF materials: written out, or by the name of a script, of Gazebo's own or of a model."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

from rosbot_patrol.simulation.ogre_scripts import MaterialScripts
from rosbot_patrol.simulation.picture_colours import Rgba
from rosbot_patrol.simulation.scene import Material
from rosbot_patrol.simulation.sdf_files import ModelPath
from rosbot_patrol.simulation.sdf_values import Place

GREY: Rgba = (0.7, 0.7, 0.7, 1.0)

# Gazebo's own scripts by name: the colour that each shows, textures by their mean.
_SCRIPTS = {
    "White": (0.95, 0.95, 0.95), "Black": (0.05, 0.05, 0.05), "FlatBlack": (0.03, 0.03, 0.03),
    "Grey": (0.7, 0.7, 0.7), "Gray": (0.7, 0.7, 0.7), "LightGrey": (0.8, 0.8, 0.8), "DarkGrey": (0.3, 0.3, 0.3),
    "ZincGrey": (0.45, 0.47, 0.50), "GreyGradientSky": (0.6, 0.62, 0.65), "CloudySky": (0.6, 0.7, 0.85),
    "Red": (0.9, 0.05, 0.05), "RedBright": (0.87, 0.26, 0.07), "RedTransparent": (0.9, 0.2, 0.2),
    "Green": (0.05, 0.8, 0.05), "GreenTransparent": (0.2, 0.8, 0.2), "Grass": (0.24, 0.42, 0.16),
    "Blue": (0.05, 0.05, 0.9), "SkyBlue": (0.13, 0.44, 0.70), "BlueTransparent": (0.2, 0.2, 0.9),
    "DarkMagentaTransparent": (0.4, 0.0, 0.4), "Indigo": (0.33, 0.0, 0.5), "Purple": (0.8, 0.0, 0.8),
    "Yellow": (0.9, 0.85, 0.05), "DarkYellow": (0.7, 0.65, 0.05), "YellowTransparent": (0.9, 0.85, 0.2),
    "Gold": (0.80, 0.65, 0.18), "Orange": (1.0, 0.51, 0.06), "OrangeTransparent": (1.0, 0.55, 0.2),
    "Turquoise": (0.06, 0.76, 0.75), "TurquoiseGlow": (0.06, 0.76, 0.75), "Bricks": (0.60, 0.33, 0.26),
    "CeilingTiled": (0.80, 0.79, 0.76), "Paper": (0.92, 0.91, 0.86), "PaintedWall": (0.83, 0.80, 0.73),
    "Wood": (0.57, 0.41, 0.26), "WoodFloor": (0.60, 0.45, 0.30), "WoodPallet": (0.62, 0.50, 0.35),
    "WoodTile": (0.55, 0.40, 0.27), "Residential": (0.62, 0.60, 0.58), "Road": (0.28, 0.28, 0.29),
    "Road1": (0.28, 0.28, 0.29), "Asphalt": (0.25, 0.25, 0.26), "Tarmac": (0.30, 0.30, 0.31),
    "OakFloor": (0.62, 0.46, 0.29), "Chrome": (0.75, 0.76, 0.78), "Metal": (0.6, 0.61, 0.63),
    "CorrugatedSheetMetal": (0.58, 0.59, 0.60), "Aluminium": (0.65, 0.66, 0.68),
}  # fmt: skip


@dataclass
class Looks:
    """Reads materials.

    Attributes:
        model_path: where the scripts of models are.
        skipped: takes the names of scripts that are not known.
    """

    model_path: ModelPath
    skipped: set[str]
    _scripts: MaterialScripts = field(default_factory=MaterialScripts)

    def material(self, visual: ET.Element, own: Rgba | None, place: Place) -> Material:
        """The material of a <visual>; `own` is the colour that its mesh brings, taken where the element names none.

        Raises:
            WorldError: a colour is no colour.
        """
        material = visual.find("material")
        if material is None:
            return Material(rgba=own or GREY)
        for tag in ("diffuse", "ambient", "emissive"):
            text = material.findtext(tag)
            if text and text.strip():
                colour = _colour(text, place.inside(f"<{tag}>"))
                if tag != "emissive" or max(colour[:3]) > 0.0:
                    return Material(rgba=colour)
        script = material.find("script")
        name = (script.findtext("name") or "").strip() if script is not None else ""
        if script is None or not name:
            return Material(rgba=own or GREY)
        known = _SCRIPTS.get(name.removeprefix("Gazebo/"))
        found = (*known, 1.0) if known is not None else self._of_model(script, name, place)
        if found is None:
            self.skipped.add(f"the material script '{name}'")
        return Material(rgba=found or own or GREY)

    def _of_model(self, script: ET.Element, name: str, place: Place) -> Rgba | None:
        places = []
        for uri in script.findall("uri"):
            found = self.model_path.look((uri.text or "").strip(), place.path.parent)
            if found is not None:
                places.append(found)
        return self._scripts.colour(name, places)


def is_unseen(visual: ET.Element, place: Place) -> bool:
    """Whether a <visual> is so transparent that it is left out; raises WorldError where <transparency> is no number."""
    text = visual.findtext("transparency")
    if text is None:
        return False
    try:
        return float(text) > 0.95
    except ValueError as err:
        raise place.inside("<transparency>").error(f"expected one number, got '{text.strip()}'") from err


def _colour(text: str, place: Place) -> Rgba:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) not in (3, 4) or not all(math.isfinite(v) and v >= 0.0 for v in values):
        raise place.error(f"expected 3 or 4 numbers, got '{' '.join(text.split())}'")
    r, g, b, a = (min(v, 1.0) for v in [*values, 1.0][:4])
    return (r, g, b, a)
