"""Catalogue of published darknet networks: files, addresses, sizes and checksums.

Sizes of weights follow from the networks. Checksums are those published by several independent projects, "" if none was
found.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.errors import DetectorError

_DARKNET = "https://pjreddie.com/media/files/"
_RELEASES = "https://github.com/AlexeyAB/darknet/releases/download/"
_MIRROR = "https://github.com/hank-ai/darknet/releases/download/v2.0/"
_FASTEST = (
    "https://raw.githubusercontent.com/dog-qiuqiu/Yolo-Fastest/96a2900d163196c396e73f3fdab04ca4dd9a2f70/"
    "ModelZoo/yolo-fastest-1.1_coco/"
)
REAL_CAMERA = "yolo-fastest-1.1-xl"
"""The network for a real camera, if it was downloaded."""


@dataclass(frozen=True, kw_only=True)
class NetworkFile:
    """One published file of a network.

    Args:
        file: its name; the ending says what it is, .cfg or .weights.
        size: [bytes].
        urls: download addresses, the authors' first, then mirrors of the same file.
        sha256: of its content, "" if unknown; likewise `md5`.
    """

    file: str
    size: int
    urls: tuple[str, ...]
    sha256: str = ""
    md5: str = ""

    @property
    def sums(self) -> dict[str, str]:
        """Known checksums by the name of their algorithm, such as sha256."""
        return {name: value for name, value in (("sha256", self.sha256), ("md5", self.md5)) if value}

    @property
    def is_cfg(self) -> bool:
        """Whether it describes the network; else it holds the weights."""
        return self.file.endswith(".cfg")

    def describe(self) -> str:
        """Name, size and checksums, so that somebody can recognise a copy."""
        known = "".join(f", {name} {value}" for name, value in self.sums.items())
        return f"{self.file} ({self.size:,} bytes{known})"


@dataclass(frozen=True, kw_only=True)
class PublishedNetwork:
    """One network and the files that have to be downloaded; the cfg files of the others are in this repository.

    Args:
        name: the name that `network:=` takes.
        files: what to download, the weights last.
    """

    name: str
    files: tuple[NetworkFile, ...]

    @property
    def size(self) -> int:
        """Size of all files [bytes]."""
        return sum(file.size for file in self.files)

    @property
    def has_cfg(self) -> bool:
        """Whether the cfg file is downloaded, too."""
        return any(file.is_cfg for file in self.files)


def check_sums(path: Path, sums: Mapping[str, str]) -> str:
    """Compare a file with its checksums.

    Args:
        path: of the file.
        sums: expected ones by the name of their algorithm.

    Returns:
        What differs, "" if nothing does.

    Raises:
        OSError: the file cannot be read.
    """
    for name, expected in sums.items():
        with path.open("rb") as file:
            found = hashlib.file_digest(file, name).hexdigest()
        if found != expected:
            return f"has the {name} {found}, expected {expected}"
    return ""


def check_file(path: Path, published: NetworkFile) -> None:
    """Check that a downloaded file is there and whole.

    Raises:
        DetectorError: it is missing, cut, or another file.
    """
    try:
        size = path.stat().st_size
        if size != published.size:
            problem = f"has {size:,} bytes, expected {published.size:,}"
        else:
            problem = check_sums(path, published.sums)
    except FileNotFoundError as err:
        raise DetectorError(f"{path} is not there") from err
    except OSError as err:
        raise DetectorError(f"{path} cannot be read: {err.strerror}") from err
    if problem:
        raise DetectorError(f"{path} is damaged: it {problem}")


def _weights(name: str, size: int, folders: tuple[str, ...], *, sha256: str = "", md5: str = "") -> PublishedNetwork:
    """A network of darknet's own: its cfg is in this repository."""
    file = f"{name}.weights"
    urls = tuple(folder + file for folder in folders)
    weights = NetworkFile(file=file, size=size, urls=urls, sha256=sha256, md5=md5)
    return PublishedNetwork(name=name, files=(weights,))


CATALOGUE = {
    entry.name: entry
    for entry in (
        PublishedNetwork(
            name=REAL_CAMERA,
            files=(
                NetworkFile(
                    file=f"{REAL_CAMERA}.cfg",
                    size=9_696,
                    urls=(f"{_FASTEST}{REAL_CAMERA}.cfg",),
                    sha256="c458427acc4fbeabceff4528ef7b65b066c0308ce599460f8ba299eba63abad3",
                ),
                NetworkFile(
                    file=f"{REAL_CAMERA}.weights",
                    size=3_693_964,
                    urls=(f"{_FASTEST}{REAL_CAMERA}.weights",),
                    sha256="fac5fb41786c1f38f04972a658443b189f48720d7d117f9a044100e98a35b0c5",
                ),
            ),
        ),
        _weights("yolov2-tiny", 44_948_600, (_DARKNET, _MIRROR), md5="04904b18f0e0835d8e1d6e75d3fa93fe"),
        _weights("yolov2-tiny-voc", 63_471_556, (_DARKNET,)),
        _weights(
            "yolov2",
            203_934_260,
            (_DARKNET, _MIRROR),
            sha256="d9945162ed6f54ce1a901e3ec537bdba4d572ecae7873087bd730e5a7942df3f",
            md5="70d89ba2e180739a1c700a9ff238e354",
        ),
        _weights("yolov2-voc", 202_704_260, (_DARKNET,)),
        _weights(
            "yolov3-tiny",
            35_434_956,
            (_DARKNET, _MIRROR),
            sha256="dccea06f59b781ec1234ddf8d1e94b9519a97f4245748a7d4db75d5b7080a42c",
            md5="3bcd6b390912c18924b46b26a9e7ff53",
        ),
        _weights(
            "yolov3",
            248_007_048,
            (_DARKNET, _MIRROR),
            sha256="523e4e69e1d015393a1b0a441cef1d9c7659e3eb2d7e15f793f060a21b32f297",
            md5="c84e5b99d0e52cd466ae710cadf6d84c",
        ),
        _weights("yolov3-voc", 246_714_648, (_DARKNET,)),
        _weights(
            "yolov4-tiny",
            24_251_276,
            (f"{_RELEASES}darknet_yolo_v4_pre/", _MIRROR),
            sha256="037676f0d929c24e1bd9a0037fe30dc416fc26e0ca2a4491a44d024873316061",
            md5="8911bf808aed305d6854c4ea48fcc731",
        ),
        _weights(
            "yolov4",
            257_717_640,
            (f"{_RELEASES}darknet_yolo_v3_optimal/",),
            sha256="e8a4f6c62188738d86dc6898d82724ec0964d0eb9d2ae0f0a9d53d65d108d562",
        ),
    )
}
