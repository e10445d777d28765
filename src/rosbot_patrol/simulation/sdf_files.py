"""Where the models and meshes of a world are found: `model://NAME` on a path, the right file by model.config."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

from rosbot_patrol.errors import WorldError
from rosbot_patrol.simulation.sdf_values import VERSIONS, Place

_SCHEMES = ("model://", "package://")  # gazebo_ros writes the one for the other


@dataclass(frozen=True)
class ModelPath:
    """Where `model://NAME/...` is looked up.

    Attributes:
        folders: in this order.
        find_package: the folder of a ROS package, looked in last.
    """

    folders: tuple[Path, ...] = ()
    find_package: Callable[[str], Path | None] | None = None

    def find(self, uri: str, base: Path, place: Place) -> Path:
        """The file or folder that a uri means.

        Args:
            uri: model://..., package://..., file://... or a path.
            base: folder that a relative path starts from.
            place: for messages.

        Raises:
            WorldError: it is nowhere; names where it was looked for, and what helps.
        """
        found = self.look(uri, base)
        if found is None:
            places = [str(path) for path in self._candidates(uri, base)]
            places = places[:1] if uri.startswith(("/", "file:///")) else list(dict.fromkeys(places))
            looked = ", ".join(places) or "no folder for model:// is given"
            raise place.error(f"'{uri}' is missing (looked for {looked}){advice(uri)}")
        return found

    def look(self, uri: str, base: Path) -> Path | None:
        """As `find`, None where it is nowhere."""
        return next((path for path in self._candidates(uri, base) if path.exists()), None)

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
        if not plain.is_absolute():  # Gazebo starts from each folder of models and of media
            yield from (place / plain for folder in self.folders for place in (folder, folder.parent))
            return
        # of another's home: whatever of it is here
        tails = (plain.relative_to(plain.parents[-1 - i]) for i in range(1, len(plain.parts) - 2))
        yield from (folder / tail for tail in tails for folder in self.folders)


def advice(uri: str) -> str:
    """What helps where a uri means nothing, to follow a sentence that says so."""
    if uri.startswith("http"):
        return "; models of the web are not fetched: download it, and name its folder's folder in GAZEBO_MODEL_PATH"
    if uri.startswith(_SCHEMES):
        return (
            "; name the folder that holds it in GAZEBO_MODEL_PATH or the parameter model_path"
            " (Gazebo's own models: github.com/osrf/gazebo_models)"
        )
    return ""


def model_file(found: Path, place: Place) -> Path:
    """The SDF file of a model's folder: the one of the highest version that is read here; a file is itself.

    Raises:
        WorldError: the folder has no SDF file, or its model.config is broken or names one that is missing.
    """
    if found.is_file():
        return found
    config = found / "model.config"
    if not config.is_file():
        file = found / "model.sdf"
        if not file.is_file():
            raise place.error(f"{found} is no model, it has neither model.config nor model.sdf")
        return file
    named = _named_in(config)
    readable = [entry for entry in named if entry[0] <= NEWEST]
    file = found / max(readable or named[:1], key=lambda entry: entry[0])[1]
    if not file.is_file():
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
