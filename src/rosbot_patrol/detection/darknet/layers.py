"""The layers of a darknet network, as plain records with their shapes."""

from __future__ import annotations

from dataclasses import dataclass, field

Shape = tuple[int, int, int]
"""Channels, height, width."""


@dataclass(frozen=True, kw_only=True)
class Layer:
    """Common part of all layers: index in the network (from 0, without [net]), line in the file, and shapes."""

    index: int
    line: int
    in_shape: Shape
    out_shape: Shape


@dataclass(frozen=True, kw_only=True)
class Convolutional(Layer):
    """A convolution; `padding` cells of zeros on each side."""

    filters: int
    size: int
    stride: int
    padding: int
    groups: int
    batch_normalize: bool
    activation: str

    @property
    def weights_shape(self) -> tuple[int, int, int, int]:
        """Filters, input channels of a group, rows, columns."""
        return (self.filters, self.in_shape[0] // self.groups, self.size, self.size)

    @property
    def parameters(self) -> int:
        """Number of its values in a weights file."""
        n, c, h, w = self.weights_shape
        return n * c * h * w + n * (4 if self.batch_normalize else 1)


@dataclass(frozen=True, kw_only=True)
class Maxpool(Layer):
    """Maximum of `size` x `size`; `padding` cells in all per axis, half of them (rounded down) before the picture."""

    size: int
    stride: int
    padding: int


@dataclass(frozen=True, kw_only=True)
class Route(Layer):
    """Concatenation of earlier layers, from each the channels of group `group_id` of `groups`."""

    layers: tuple[int, ...]
    groups: int
    group_id: int


@dataclass(frozen=True, kw_only=True)
class Shortcut(Layer):
    """Sum of the previous layer and earlier layers."""

    layers: tuple[int, ...]
    activation: str


@dataclass(frozen=True, kw_only=True)
class Upsample(Layer):
    """Repetition of each cell `stride` times in both directions, multiplied by `scale`."""

    stride: int
    scale: float


@dataclass(frozen=True, kw_only=True)
class Reorg(Layer):
    """Darknet's own way of folding `stride` x `stride` cells into channels."""

    stride: int


@dataclass(frozen=True, kw_only=True)
class Dropout(Layer):
    """No operation at run time."""


@dataclass(frozen=True, kw_only=True)
class Head(Layer):
    """A layer that outputs boxes.

    Args:
        anchors: width and height of this head's boxes, shape (boxes of a cell, 2) as tuples; of [region] in cells, of
            [yolo] in pixels of the network's input.
        classes: number of classes.
    """

    anchors: tuple[tuple[float, float], ...]
    classes: int


@dataclass(frozen=True, kw_only=True)
class Region(Head):
    """YOLOv2's head."""

    softmax: bool
    background: bool


@dataclass(frozen=True, kw_only=True)
class Yolo(Head):
    """The head of YOLOv3 and v4; `new_coords` is scaled-YOLOv4's box format."""

    scale_x_y: float
    new_coords: bool


@dataclass(frozen=True)
class NetworkSpec:
    """A whole network.

    Args:
        source: its file, for messages.
        channels: of the input, height and width of it [px].
        layers: in order.
        text: contents of the file.
    """

    source: str
    channels: int
    height: int
    width: int
    layers: tuple[Layer, ...]
    text: str = field(default="", repr=False)

    @property
    def convolutions(self) -> list[Convolutional]:
        """Layers with weights, in the order of the weights file."""
        return [layer for layer in self.layers if isinstance(layer, Convolutional)]

    @property
    def heads(self) -> list[Head]:
        """Layers that output boxes."""
        return [layer for layer in self.layers if isinstance(layer, Head)]

    @property
    def classes(self) -> int:
        """Number of classes."""
        return self.heads[0].classes if self.heads else 0

    @property
    def parameters(self) -> int:
        """Number of values in its weights file."""
        return sum(layer.parameters for layer in self.convolutions)
