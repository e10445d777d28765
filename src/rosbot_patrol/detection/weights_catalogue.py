"""Catalogue of published weights files for darknet_ros's networks: address, size and checksum.

Sizes follow from the networks. Checksums are those published by several independent projects, "" if none was found.
"""

from __future__ import annotations

from dataclasses import dataclass

_DARKNET = "https://pjreddie.com/media/files/"
_RELEASES = "https://github.com/AlexeyAB/darknet/releases/download/"


@dataclass(frozen=True, kw_only=True)
class WeightsFile:
    """One weights file.

    Args:
        name: of its network; the file is called NAME.weights.
        size: [bytes].
        url: its authors' download address.
        sha256: of its content, "" if unknown.
    """

    name: str
    size: int
    url: str
    sha256: str = ""

    @property
    def file(self) -> str:
        """The file's name."""
        return f"{self.name}.weights"

    def describe(self) -> str:
        """Name, size and checksum, so that somebody can recognise a copy."""
        known = f", sha256 {self.sha256}" if self.sha256 else ""
        return f"{self.file} ({self.size:,} bytes{known})"


CATALOGUE = {
    entry.name: entry
    for entry in (
        WeightsFile(name="yolov2-tiny", size=44_948_600, url=f"{_DARKNET}yolov2-tiny.weights"),
        WeightsFile(name="yolov2-tiny-voc", size=63_471_556, url=f"{_DARKNET}yolov2-tiny-voc.weights"),
        WeightsFile(
            name="yolov2",
            size=203_934_260,
            url=f"{_DARKNET}yolov2.weights",
            sha256="d9945162ed6f54ce1a901e3ec537bdba4d572ecae7873087bd730e5a7942df3f",
        ),
        WeightsFile(name="yolov2-voc", size=202_704_260, url=f"{_DARKNET}yolov2-voc.weights"),
        WeightsFile(
            name="yolov3-tiny",
            size=35_434_956,
            url=f"{_DARKNET}yolov3-tiny.weights",
            sha256="dccea06f59b781ec1234ddf8d1e94b9519a97f4245748a7d4db75d5b7080a42c",
        ),
        WeightsFile(
            name="yolov3",
            size=248_007_048,
            url=f"{_DARKNET}yolov3.weights",
            sha256="523e4e69e1d015393a1b0a441cef1d9c7659e3eb2d7e15f793f060a21b32f297",
        ),
        WeightsFile(name="yolov3-voc", size=246_714_648, url=f"{_DARKNET}yolov3-voc.weights"),
        WeightsFile(
            name="yolov4-tiny",
            size=24_251_276,
            url=f"{_RELEASES}darknet_yolo_v4_pre/yolov4-tiny.weights",
            sha256="037676f0d929c24e1bd9a0037fe30dc416fc26e0ca2a4491a44d024873316061",
        ),
        WeightsFile(
            name="yolov4",
            size=257_717_640,
            url=f"{_RELEASES}darknet_yolo_v3_optimal/yolov4.weights",
            sha256="e8a4f6c62188738d86dc6898d82724ec0964d0eb9d2ae0f0a9d53d65d108d562",
        ),
    )
}
