"""Reader of darknet's network files (.cfg): a checked list of layers with their shapes.

Matches the parser of darknet (pjreddie/darknet, as in darknet_ros) for the layers of YOLOv2, v3 and v4, tiny and full,
with the options of AlexeyAB's version that those use (groups of a route, mish, scale_x_y).

Differs: options that only affect training are ignored. An unknown layer or activation, or a shape that does not fit, is
an error that names file and line; darknet guesses or dies.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from rosbot_patrol.detection.darknet.layers import (
    Convolutional,
    Dropout,
    Layer,
    Maxpool,
    NetworkSpec,
    Region,
    Reorg,
    Route,
    Shape,
    Shortcut,
    Upsample,
    Yolo,
)
from rosbot_patrol.errors import DetectorError

ACTIVATIONS = ("linear", "leaky", "logistic", "relu", "mish", "swish", "tanh")


@dataclass(frozen=True)
class Section:
    """One `[name]` of a cfg file with its `key=value` lines.

    Args:
        name: the name between the brackets.
        source: the file, for messages.
        line: where it starts, counted from 1.
        options: value and line of each key.
    """

    name: str
    source: str
    line: int
    options: dict[str, tuple[str, int]] = field(default_factory=dict)

    def fail(self, problem: str, key: str = "") -> DetectorError:
        """Make the error for a problem of this section or one of its keys."""
        line = self.options[key][1] if key in self.options else self.line
        return DetectorError(f"{self.source}, line {line}: [{self.name}] {problem}")

    def text(self, key: str, default: str) -> str:
        """A value as text."""
        return self.options[key][0] if key in self.options else default

    def integer(self, key: str, default: int, *, lo: int | None = None) -> int:
        """A value as a whole number, at least `lo`."""
        text = self.text(key, str(default))
        try:
            value = int(text)
        except ValueError:
            raise self.fail(f"{key}={text} is not a whole number", key) from None
        if lo is not None and value < lo:
            raise self.fail(f"{key}={value}, expected at least {lo}", key)
        return value

    def number(self, key: str, default: float) -> float:
        """A value as a number."""
        return self._numbers(key, str(default))[0]

    def numbers(self, key: str) -> tuple[float, ...]:
        """A value as a list of numbers, () if it is missing."""
        return self._numbers(key, "")

    def integers(self, key: str) -> tuple[int, ...]:
        """A value as a list of whole numbers, () if it is missing."""
        values = self._numbers(key, "")
        if any(not v.is_integer() for v in values):
            raise self.fail(f"{key}={self.text(key, '')} are not whole numbers", key)
        return tuple(int(v) for v in values)

    def _numbers(self, key: str, default: str) -> tuple[float, ...]:
        text = self.text(key, default)
        try:
            return tuple(float(part) for part in text.split(",") if part.strip())
        except ValueError:
            raise self.fail(f"{key}={text} is not made of numbers", key) from None


def parse_sections(text: str, source: str = "cfg") -> list[Section]:
    """Split a cfg file into sections.

    Raises:
        DetectorError: a line is neither a section, a key with a value, a comment nor empty.
    """
    sections: list[Section] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.replace(" ", "").replace("\t", "").strip("\ufeff\r\n")
        if not line or line[0] in "#;":
            continue
        if line[0] == "[":
            if line[-1] != "]" or len(line) < 3:
                raise DetectorError(f"{source}, line {number}: '{raw.strip()}' is no section, expected [name]")
            sections.append(Section(line[1:-1], source, number))
            continue
        key, equals, value = line.partition("=")
        if not equals or not key:
            raise DetectorError(f"{source}, line {number}: '{raw.strip()}' is neither [section] nor key=value")
        if not sections:
            raise DetectorError(f"{source}, line {number}: '{raw.strip()}' stands before the first [section]")
        sections[-1].options[key] = (value, number)
    return sections


def parse_cfg(text: str, source: str = "cfg") -> NetworkSpec:
    """Build the network that a cfg file describes.

    Args:
        text: contents of the file.
        source: its name, for messages.

    Raises:
        DetectorError: names file, line and problem.
    """
    sections = parse_sections(text, source)
    if not sections:
        raise DetectorError(f"{source}: has no sections, expected a darknet network")
    net = sections[0]
    if net.name not in ("net", "network"):
        raise net.fail("comes first, expected [net]")
    shape = (net.integer("channels", 3, lo=1), net.integer("height", 0, lo=1), net.integer("width", 0, lo=1))
    layers: list[Layer] = []
    for section in sections[1:]:
        builder = _BUILDERS.get(section.name)
        if builder is None:
            known = ", ".join(sorted(_BUILDERS))
            raise section.fail(f"is a layer that is not known here, expected one of {known}")
        layers.append(builder(section, layers, layers[-1].out_shape if layers else shape))
    if not layers:
        raise net.fail("has no layers after it")
    spec = NetworkSpec(source, *shape, tuple(layers), text)
    if not spec.heads:
        raise DetectorError(f"{source}: has neither [region] nor [yolo], so it finds no boxes")
    if len({head.classes for head in spec.heads}) > 1:
        raise DetectorError(f"{source}: its heads disagree on classes: {', '.join(str(h.classes) for h in spec.heads)}")
    return spec


def read_cfg(path: str) -> NetworkSpec:
    """Read and parse a cfg file; DetectorError as in `parse_cfg`, or if the file cannot be read."""
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read()
    except (OSError, UnicodeDecodeError) as err:
        reason = err.strerror if isinstance(err, OSError) else "is no text"
        raise DetectorError(f"the network file {path} cannot be read: {reason}") from err
    return parse_cfg(text, path)


def _common(section: Section, layers: list[Layer], in_shape: Shape, out_shape: Shape) -> dict[str, Any]:
    if min(out_shape) < 1:
        raise section.fail(f"gives {_dims(out_shape)} from {_dims(in_shape)}, nothing is left")
    return {"index": len(layers), "line": section.line, "in_shape": in_shape, "out_shape": out_shape}


def _dims(shape: Shape) -> str:
    return f"{shape[2]}x{shape[1]}x{shape[0]}"


def _activation(section: Section, default: str) -> str:
    name = section.text("activation", default)
    if name not in ACTIVATIONS:
        raise section.fail(
            f"activation={name} is not known here, expected one of {', '.join(ACTIVATIONS)}", "activation"
        )
    return name


def _convolutional(section: Section, layers: list[Layer], shape: Shape) -> Layer:
    filters, size = section.integer("filters", 1, lo=1), section.integer("size", 1, lo=1)
    stride, groups = section.integer("stride", 1, lo=1), section.integer("groups", 1, lo=1)
    padding = size // 2 if section.integer("pad", 0) else section.integer("padding", 0, lo=0)
    if shape[0] % groups or filters % groups:
        raise section.fail(f"groups={groups} divides neither {shape[0]} channels nor {filters} filters", "groups")
    if section.integer("dilation", 1) != 1:
        raise section.fail("dilation is not supported here", "dilation")
    height, width = ((n + 2 * padding - size) // stride + 1 for n in shape[1:])
    return Convolutional(
        **_common(section, layers, shape, (filters, height, width)),
        filters=filters,
        size=size,
        stride=stride,
        padding=padding,
        groups=groups,
        batch_normalize=bool(section.integer("batch_normalize", 0)),
        activation=_activation(section, "logistic"),
    )


def _maxpool(section: Section, layers: list[Layer], shape: Shape) -> Layer:
    stride = section.integer("stride", 1, lo=1)
    size = section.integer("size", stride, lo=1)
    padding = section.integer("padding", size - 1, lo=0)
    height, width = ((n + padding - size) // stride + 1 for n in shape[1:])
    common = _common(section, layers, shape, (shape[0], height, width))
    return Maxpool(**common, size=size, stride=stride, padding=padding)


def _sources(section: Section, layers: list[Layer], key: str) -> tuple[int, ...]:
    found = []
    for number in section.integers(key):
        index = number + len(layers) if number < 0 else number
        if not 0 <= index < len(layers):
            raise section.fail(f"{key}={number} is no earlier layer, this is layer {len(layers)}", key)
        found.append(index)
    if not found:
        raise section.fail(f"needs {key}=")
    return tuple(found)


def _route(section: Section, layers: list[Layer], shape: Shape) -> Layer:
    sources = _sources(section, layers, "layers")
    groups, group_id = section.integer("groups", 1, lo=1), section.integer("group_id", 0, lo=0)
    shapes = [layers[i].out_shape for i in sources]
    if len({s[1:] for s in shapes}) > 1:
        raise section.fail(f"joins layers of different size: {', '.join(_dims(s) for s in shapes)}", "layers")
    if any(s[0] % groups for s in shapes) or group_id >= groups:
        raise section.fail(f"groups={groups}, group_id={group_id} does not fit {_dims(shapes[0])}", "groups")
    out = (sum(s[0] // groups for s in shapes), *shapes[0][1:])
    common = _common(section, layers, shape, out)
    return Route(**common, layers=sources, groups=groups, group_id=group_id)


def _shortcut(section: Section, layers: list[Layer], shape: Shape) -> Layer:
    sources = _sources(section, layers, "from")
    for source in sources:
        if layers[source].out_shape != shape:
            raise section.fail(f"adds {_dims(layers[source].out_shape)} to {_dims(shape)}", "from")
    activation = _activation(section, "linear")
    return Shortcut(**_common(section, layers, shape, shape), layers=sources, activation=activation)


def _upsample(section: Section, layers: list[Layer], shape: Shape) -> Layer:
    stride = section.integer("stride", 2, lo=1)
    out = (shape[0], shape[1] * stride, shape[2] * stride)
    return Upsample(**_common(section, layers, shape, out), stride=stride, scale=section.number("scale", 1.0))


def _reorg(section: Section, layers: list[Layer], shape: Shape) -> Layer:
    stride = section.integer("stride", 1, lo=1)
    for key in ("reverse", "flatten", "extra"):
        if section.integer(key, 0):
            raise section.fail(f"{key} is not supported here", key)
    if shape[0] % (stride * stride) or shape[1] % stride or shape[2] % stride:
        raise section.fail(f"stride={stride} does not divide {_dims(shape)}", "stride")
    out = (shape[0] * stride * stride, shape[1] // stride, shape[2] // stride)
    return Reorg(**_common(section, layers, shape, out), stride=stride)


def _dropout(section: Section, layers: list[Layer], shape: Shape) -> Layer:
    return Dropout(**_common(section, layers, shape, shape))


def _head(section: Section, layers: list[Layer], shape: Shape, boxes: int, per_box: int) -> dict[str, Any]:
    if shape[0] != boxes * per_box:
        raise section.fail(
            f"needs {boxes} boxes x {per_box} values = {boxes * per_box} channels, the layer before has {shape[0]}"
        )
    return _common(section, layers, shape, shape)


def _pairs(section: Section, expected: int) -> list[tuple[float, float]]:
    values = section.numbers("anchors")
    if len(values) != 2 * expected:
        raise section.fail(f"has {len(values)} anchor values, expected 2 x {expected}", "anchors")
    return list(zip(values[::2], values[1::2], strict=True))


def _region(section: Section, layers: list[Layer], shape: Shape) -> Layer:
    boxes, classes = section.integer("num", 1, lo=1), section.integer("classes", 20, lo=1)
    if section.integer("coords", 4) != 4:
        raise section.fail("coords other than 4 are not supported here", "coords")
    if "tree" in section.options:
        raise section.fail("tree= (YOLO9000) is not supported here", "tree")
    background = bool(section.integer("background", 0))
    common = _head(section, layers, shape, boxes, classes + 5)
    softmax = bool(section.integer("softmax", 0))
    anchors = tuple(_pairs(section, boxes))
    return Region(**common, anchors=anchors, classes=classes, softmax=softmax, background=background)


def _yolo(section: Section, layers: list[Layer], shape: Shape) -> Layer:
    total, classes = section.integer("num", 1, lo=1), section.integer("classes", 20, lo=1)
    mask = section.integers("mask") or tuple(range(total))
    if any(not 0 <= m < total for m in mask):
        raise section.fail(f"mask={section.text('mask', '')} names an anchor beyond num={total}", "mask")
    every = _pairs(section, total)
    common = _head(section, layers, shape, len(mask), classes + 5)
    return Yolo(
        **common,
        anchors=tuple(every[m] for m in mask),
        classes=classes,
        scale_x_y=section.number("scale_x_y", 1.0),
        new_coords=bool(section.integer("new_coords", 0)),
    )


_BUILDERS = {
    "convolutional": _convolutional,
    "conv": _convolutional,
    "maxpool": _maxpool,
    "max": _maxpool,
    "route": _route,
    "shortcut": _shortcut,
    "upsample": _upsample,
    "reorg": _reorg,
    "dropout": _dropout,
    "region": _region,
    "yolo": _yolo,
}
