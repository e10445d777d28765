"""Search for a world's models and meshes: `model://NAME` on a path, and the right file by model.config."""

from __future__ import annotations

import os.path
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as ET

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.sdf.values import VERSIONS, Place

_SCHEMES = ("model://", "package://")  # gazebo_ros converts one to the other


@dataclass(frozen=True)
class ModelPath:
    """Search path of `model://NAME/...`.

    Attributes:
        folders: searched in this order.
        find_package: finds the folder of a ROS package, searched last.
    """

    folders: tuple[Path, ...] = ()
    find_package: Callable[[str], Path | None] | None = None

    def find(self, uri: str, base: Path, place: Place) -> Path:
        """Find the file or folder of a URI.

        Args:
            uri: model://..., package://..., file://... or a path.
            base: start folder of a relative path.
            place: position in the world file, for messages.

        Raises:
            WorldError: it was not found; the text names the searched places and what helps.
        """
        found = self.look(uri, base)
        if found is None:
            places = [str(path) for path in self._candidates(uri, base)]
            places = places[:1] if uri.startswith(("/", "file:///")) else list(dict.fromkeys(places))
            looked = ", ".join(places) or "no folder for model:// is given"
            raise place.error(f"'{uri}' is missing (looked for {looked}){advice(uri)}")
        return found

    def look(self, uri: str, base: Path) -> Path | None:
        """Find as in `find`, None if it was not found."""
        # os.path: a name that is too long or an unreadable folder means "not found", and no error
        return next((path for path in self._candidates(uri, base) if os.path.exists(path)), None)

    def _candidates(self, uri: str, base: Path) -> Iterator[Path]:
        for scheme in _SCHEMES:
            if uri.startswith(scheme):
                inner = uri.removeprefix(scheme).strip("/")
                yield from (folder / inner for folder in self.folders)
                name, _, rest = inner.partition("/")
                package = self.find_package(name) if self.find_package is not None else None
                if package is not None:
                    yield package / rest
                return
        plain = Path(uri.removeprefix("file://"))
        yield base / plain
        if not plain.is_absolute():  # as in Gazebo, relative to each folder of models and of media
            yield from (place / plain for folder in self.folders for place in (folder, folder.parent))
            return
        # a path in somebody else's home: try its tail in the folders here
        tails = (plain.relative_to(plain.parents[-1 - i]) for i in range(1, len(plain.parts) - 2))
        yield from (folder / tail for tail in tails for folder in self.folders)


Part = Literal["model", "collision", "visual"]
_EFFECT: dict[Part, str] = {"model": "left out", "collision": "left out", "visual": "shown by collision shapes"}


@dataclass
class LostFiles:
    """Missing or broken files that a world names: like Gazebo, the reader reports them and goes on."""

    _sentences: dict[str, str] = field(default_factory=dict)
    _wanted: Counter[str] = field(default_factory=Counter)
    _parts: Counter[Part] = field(default_factory=Counter)

    def add(self, uri: str, part: Part, place: Place, error: WorldError) -> None:
        """Record that a part of the world lacks a file.

        Args:
            uri: the file, as written in the world.
            part: the part without the file.
            place: position of the reference in the world file.
            error: what is wrong with the file.
        """
        is_the_same_everywhere = uri.startswith((*_SCHEMES, "http", "/", "file:///"))
        file = uri if is_the_same_everywhere else f"{place.path.parent}/{uri}"
        sentence = str(error) if error.path == str(place.path) else str(place.error(str(error)))
        self._sentences.setdefault(file, sentence)
        self._wanted[file] += 1
        self._parts[part] += 1

    def __len__(self) -> int:
        return len(self._sentences)

    def sentences(self) -> tuple[str, ...]:
        """One sentence per file: its first user, the problem, and the number of further users."""
        more = {file: self._wanted[file] - 1 for file in self._sentences}
        return tuple(
            sentence + (f" (wanted in {count_of(more[file], 'more place')})" if more[file] else "")
            for file, sentence in self._sentences.items()
        )

    def summary(self) -> str:
        """Number of lost files and the consequence, "" if there are none."""
        if not self._sentences:
            return ""
        costs = ", ".join(f"{count_of(self._parts[p], p)} {_EFFECT[p]}" for p in _EFFECT if self._parts[p])
        return f"{count_of(len(self), 'file')} cannot be used: {costs}"


def advice(uri: str) -> str:
    """Remedy for a URI that was not found, to follow the sentence about it."""
    if uri.startswith("http"):
        return "; models of the web are not fetched: download it, and name its folder's folder in GAZEBO_MODEL_PATH"
    if uri.startswith(_SCHEMES):
        return (
            "; name the folder that holds it in GAZEBO_MODEL_PATH or the parameter model_path"
            " (Gazebo's own models: github.com/osrf/gazebo_models)"
        )
    return ""


def model_file(found: Path, place: Place) -> Path:
    """SDF file of a model's folder: the one of the highest version supported here; a file stands for itself.

    Raises:
        WorldError: the folder has no SDF file, or its model.config is broken or names a missing one.
    """
    if os.path.isfile(found):
        return found
    config = found / "model.config"
    if not os.path.isfile(config):
        file = found / "model.sdf"
        if not os.path.isfile(file):
            raise place.error(f"{found} is no model, it has neither model.config nor model.sdf")
        return file
    named = _named_in(config)
    readable = [entry for entry in named if entry[0] <= NEWEST]
    file = found / max(readable or named[:1], key=lambda entry: entry[0])[1]
    if not os.path.isfile(file):
        raise WorldError(config, f"names the file '{file.name}', which is missing")
    return file


def _named_in(config: Path) -> list[tuple[tuple[int, ...], str]]:
    """(version, file name) of each <sdf> of a model.config."""
    try:
        root = ET.fromstring(config.read_bytes())
    except OSError as err:
        raise WorldError(config, f"cannot be read: {err.strerror}") from err
    except (ET.ParseError, LookupError, ValueError) as err:
        raise WorldError(config, f"is not XML, or not all of it: {err}") from err
    named = [(_version(e.get("version", "")), (e.text or "").strip()) for e in root.findall("sdf")]
    named = [entry for entry in named if entry[1]]
    if not named:
        raise WorldError(config, "has no <sdf> that names the model's file")
    return named


def _version(text: str) -> tuple[int, ...]:
    return tuple(int(word) for word in text.strip().split(".") if word.isdigit())


NEWEST = _version(VERSIONS[-1])
