"""Ogre material scripts of Gazebo's models: only the colour, or the texture's mean colour, is used."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from pathlib import Path

from rosbot_patrol.simulation.meshes.colours import Rgba, worn_colour

log = logging.getLogger(__name__)


@dataclass
class MaterialScripts:
    """Reader of script files; it reads each file once."""

    _files: dict[Path, dict[str, list[list[str]]]] = field(default_factory=dict)

    def look(self, name: str, places: list[Path]) -> tuple[Rgba, bool] | None:
        """Colour of a named material, and whether it comes from a picture; None if the material was not found.

        Args:
            name: name of the material.
            places: folders or files of scripts.
        """
        for place in places:
            for file in sorted(place.glob("*.material")) if place.is_dir() else [place]:
                if file not in self._files:
                    self._files[file] = _read(file)
                lines = self._files[file].get(name)
                if lines is not None:
                    return _look(lines, [file.parent, *(p for p in places if p.is_dir())])
        return None


def _read(file: Path) -> dict[str, list[list[str]]]:
    """The lines of each material by its name, split into words."""
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError as err:
        log.warning("%s: the material script cannot be read: %s", file, err.strerror)
        return {}
    found: dict[str, list[list[str]]] = {}
    lines: list[list[str]] = []
    for line in text.splitlines():
        words = line.split("//")[0].split()
        if words[:1] == ["material"] and len(words) > 1:
            lines = found[words[1].strip('"')] = []
        elif words:
            lines.append(words)
    return found


def _look(lines: list[list[str]], folders: list[Path]) -> tuple[Rgba, bool] | None:
    textures = [words[1] for words in lines if words[0] == "texture" and len(words) > 1]
    for folder in folders:
        worn = worn_colour(textures, folder)
        if worn is not None:
            return worn, True
    for key in ("diffuse", "ambient", "emissive"):
        for words in lines:
            if words[0] == key and len(words) > 3:
                try:
                    r, g, b = (min(max(float(word), 0.0), 1.0) for word in words[1:4])
                except ValueError:
                    continue
                return (r, g, b, 1.0), False
    return None
