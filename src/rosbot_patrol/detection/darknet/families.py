"""YOLO networks as short descriptions, and their cfg files.

The layers are those of Redmon and Farhadi, "YOLO9000: Better, Faster, Stronger" (2017) and "YOLOv3: An Incremental
Improvement" (2018), of Bochkovskiy, Wang and Liao, "YOLOv4: Optimal Speed and Accuracy of Object Detection" (2020) and,
for its tiny form, of "Scaled-YOLOv4" (2021). Anchors and sizes belong to the published weights; a test checks that the
networks need weights files of those sizes.

A description is a row of words:

    64          convolution of 3x3 with 64 filters, batch normalisation, leaky     64.2     the same with stride 2
    64/1        the same of 1x1                                                    64m      the same with mish
    mp, mp1     maxpool 2x2 with stride 2, with stride 1                           mp5      5x5 with stride 1
    r-1,61      route of those layers                                              half     second half of the channels
    add         shortcut from three back                                           up       upsample by 2
    reorg       reorg by 2                                                         out      convolution before a head
    region      the head of YOLOv2                                                 yolo:3,4,5:1.1  of YOLOv3 or v4, with
                                                                                            its mask and scale_x_y
"""

from __future__ import annotations

import re
from dataclasses import dataclass

COCO, VOC = 80, 20


@dataclass(frozen=True, kw_only=True)
class Family:
    """One network.

    Args:
        layers: its description.
        size: width and height of its input [px].
        classes: number of classes.
        anchors: width and height of each, in cells for [region], in pixels for [yolo].
    """

    layers: str
    size: int
    classes: int
    anchors: str


def _residual(filters: int, times: int) -> str:
    return f"{filters}.2" + f" {filters // 2}/1 {filters} add" * times


def _pyramid(filters: int, mask: str) -> str:
    return f"{filters // 2}/1 {filters} " * 3 + f"out yolo:{mask}"


def _partial(filters: int) -> str:
    """A cross-stage partial block of the tiny YOLOv4."""
    return f"{filters} half {filters // 2} {filters // 2} r-1,-2 {filters}/1 r-6,-1 mp"


def _stage(filters: int, blocks: int) -> str:
    """A cross-stage partial stage of YOLOv4's Darknet53."""
    half = filters if blocks == 1 else filters // 2
    inner = f"{filters // 2}/1m {half}m add " * blocks
    return f"{filters}.2m {half}/1m r-2 {half}/1m {inner}{half}/1m r-1,-{4 + 3 * blocks} {filters}/1m"


_TINY = "16 mp 32 mp 64 mp 128 mp 256 mp 512 mp1 1024"
_DARKNET19 = "32 mp 64 mp 128 64/1 128 mp 256 128/1 256 mp 512 256/1 512 256/1 512 mp 1024 512/1 1024 512/1 1024"
_YOLO2 = f"{_DARKNET19} 1024 1024 r-9 64/1 reorg r-1,-4 1024 out region"
_DARKNET53 = " ".join(["32", *(_residual(64 * 2**i, n) for i, n in enumerate((1, 2, 8, 8, 4)))])
_YOLO3 = " ".join(
    [
        _DARKNET53,
        _pyramid(1024, "6,7,8"),
        f"r-4 256/1 up r-1,61 {_pyramid(512, '3,4,5')}",
        f"r-4 128/1 up r-1,36 {_pyramid(256, '0,1,2')}",
    ]
)
_YOLO3_TINY = f"{_TINY} 256/1 512 out yolo:3,4,5 r-4 128/1 up r-1,8 256 out yolo:0,1,2"
_YOLO4_TINY = " ".join(
    [
        *("32.2 64.2", *map(_partial, (64, 128, 256))),
        "512 256/1 512 out yolo:3,4,5:1.05 r-4 128/1 up r-1,23 256 out yolo:1,2,3:1.05",
    ]
)
_YOLO4 = " ".join(
    [
        *("32m", *(_stage(64 * 2**i, n) for i, n in enumerate((1, 2, 8, 8, 4)))),
        "512/1 1024 512/1 mp5 r-2 mp9 r-4 mp13 r-1,-3,-5,-6 512/1 1024 512/1",
        "256/1 up r85 256/1 r-1,-3 256/1 512 256/1 512 256/1",
        "128/1 up r54 128/1 r-1,-3 128/1 256 128/1 256 128/1 256 out yolo:0,1,2:1.2",
        "r-4 256.2 r-1,-16 256/1 512 256/1 512 256/1 512 out yolo:3,4,5:1.1",
        "r-4 512.2 r-1,-37 512/1 1024 512/1 1024 512/1 1024 out yolo:6,7,8:1.05",
    ]
)

_ANCHORS2 = "0.57273,0.677385, 1.87446,2.06253, 3.33843,5.47434, 7.88282,3.52778, 9.77052,9.16828"
_ANCHORS2_VOC = "1.3221,1.73145, 3.19275,4.00944, 5.05587,8.09892, 9.47112,4.84053, 11.2364,10.0071"
_ANCHORS2_TINY_VOC = "1.08,1.19, 3.42,4.41, 6.63,11.38, 9.42,5.11, 16.62,10.52"
_ANCHORS3 = "10,13, 16,30, 33,23, 30,61, 62,45, 59,119, 116,90, 156,198, 373,326"
_ANCHORS4 = "12,16, 19,36, 40,28, 36,75, 76,55, 72,146, 142,110, 192,243, 459,401"
_ANCHORS_TINY = "10,14, 23,27, 37,58, 81,82, 135,169, 344,319"

FAMILIES = {
    "yolov2-tiny": Family(layers=f"{_TINY} 512 out region", size=416, classes=COCO, anchors=_ANCHORS2),
    "yolov2-tiny-voc": Family(layers=f"{_TINY} 1024 out region", size=416, classes=VOC, anchors=_ANCHORS2_TINY_VOC),
    "yolov2": Family(layers=_YOLO2, size=608, classes=COCO, anchors=_ANCHORS2),
    "yolov2-voc": Family(layers=_YOLO2, size=416, classes=VOC, anchors=_ANCHORS2_VOC),
    "yolov3-tiny": Family(layers=_YOLO3_TINY, size=416, classes=COCO, anchors=_ANCHORS_TINY),
    "yolov3": Family(layers=_YOLO3, size=608, classes=COCO, anchors=_ANCHORS3),
    "yolov3-voc": Family(layers=_YOLO3, size=416, classes=VOC, anchors=_ANCHORS3),
    "yolov4-tiny": Family(layers=_YOLO4_TINY, size=416, classes=COCO, anchors=_ANCHORS_TINY),
    "yolov4": Family(layers=_YOLO4, size=608, classes=COCO, anchors=_ANCHORS4),
}


def cfg_text(family: Family, *, size: int | None = None, thinner: int = 1) -> str:
    """Text of a network's cfg file.

    Args:
        family: the network.
        size: another size of its input [px], a multiple of 32.
        thinner: divide the filters of all layers by this, except before a head; for tests.
    """
    side = str(size or family.size)
    parts = [_section("net", batch="1", subdivisions="1", width=side, height=side, channels="3")]
    words = family.layers.split()
    for i, word in enumerate(words):
        parts.append(_layer(family, word, words[i + 1] if i + 1 < len(words) else "", thinner))
    return "\n".join(parts)


def _section(name: str, **options: str) -> str:
    return f"[{name}]\n" + "".join(f"{key}={value}\n" for key, value in options.items())


def _layer(family: Family, word: str, after: str, thinner: int) -> str:
    anchors = len(family.anchors.split(",")) // 2
    if word == "out":
        boxes = after.count(",") + 1 if after.startswith("yolo") else anchors
        filters = str(boxes * (family.classes + 5))
        return _section("convolutional", filters=filters, size="1", stride="1", pad="1", activation="linear")
    if word == "region":
        common = {"classes": str(family.classes), "coords": "4", "num": str(anchors), "softmax": "1"}
        return _section("region", anchors=family.anchors, bias_match="1", **common)
    if word.startswith("yolo:"):
        _, mask, *scale = word.split(":")
        options = {"anchors": family.anchors, "classes": str(family.classes), "num": str(anchors)}
        return _section("yolo", mask=mask, **options, **({"scale_x_y": scale[0]} if scale else {}))
    if route := re.fullmatch(r"r(-?\d.*)", word):
        return _section("route", layers=route[1])
    if word in _FIXED:
        name, options = _FIXED[word]
        return _section(name, **options)
    return _convolution(word, thinner)


def _convolution(word: str, thinner: int) -> str:
    found = re.fullmatch(r"(\d+)(?:/(\d))?(?:\.(\d))?(m?)", word)
    if found is None:
        raise ValueError(f"'{word}' is no word of a network's description")
    filters, size, stride, mish = found.groups()
    return _section(
        "convolutional",
        batch_normalize="1",
        filters=str(int(filters) // thinner),
        size=size or "3",
        stride=stride or "1",
        pad="1",
        activation="mish" if mish else "leaky",
    )


_FIXED: dict[str, tuple[str, dict[str, str]]] = {
    "mp": ("maxpool", {"size": "2", "stride": "2"}),
    "mp1": ("maxpool", {"size": "2", "stride": "1"}),
    **{f"mp{size}": ("maxpool", {"size": str(size), "stride": "1"}) for size in (5, 9, 13)},
    "add": ("shortcut", {"from": "-3", "activation": "linear"}),
    "half": ("route", {"layers": "-1", "groups": "2", "group_id": "1"}),
    "up": ("upsample", {"stride": "2"}),
    "reorg": ("reorg", {"stride": "2"}),
}
