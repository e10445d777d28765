"""Builder of an ONNX graph from a frozen SSD graph of TensorFlow's object-detection API.

The graph takes an unscaled picture (uint8, rows, columns, channels) and `order`, the indices of its red, green and blue
channels. It stretches the picture bilinearly to the network's input, as the wheel's own code does with OpenCV. The
outputs are the values of all anchors, row by row of each feature map: `encodings` (anchors, 4) and `logits`
(anchors, classes with the background first). TensorFlow's loops for resizing and for suppression are left out;
`decode` does the latter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from rosbot_patrol.detection.ssd.graph_def import Graph, Node
from rosbot_patrol.errors import DetectorError

OPSET = 18
IR_VERSION = 8
INPUT = "Preprocessor/map/TensorArrayStack/TensorArrayGatherV3"
"""Resized pictures in TensorFlow's graph."""
OUTPUTS = {"encodings": ("concat", 4), "logits": ("concat_1", 2)}
"""Our output: TensorFlow's node that joins the feature maps, and the values of one anchor."""


def build_model(graph: Graph, *, size: int) -> bytes:
    """Build the serialised ONNX graph.

    Args:
        graph: the frozen graph.
        size: width and height of the network's input [px].

    Raises:
        DetectorError: it is another network, or has an operation that is not known here.
    """
    return _Builder(graph).build(size)


class _Builder:
    """A graph under construction: nodes, constants, and the name of each TensorFlow node's output."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._nodes: list[onnx.NodeProto] = []
        self._constants: list[onnx.TensorProto] = []
        self._outputs: dict[str, str] = {}

    def build(self, size: int) -> bytes:
        heads = {name: self._heads(joined) for name, (joined, _) in OUTPUTS.items()}
        self._outputs[INPUT] = self._stretch(size)
        for node in self._graph.order([head for found in heads.values() for head in found], [INPUT]):
            if node.op not in _EMIT:
                raise DetectorError(f"{self._graph.source}: the operation {node.op} ({node.name}) is not known here")
            self._outputs[node.name] = _EMIT[node.op](self, node)
        for name, (_, values) in OUTPUTS.items():
            self._join(heads[name], values, name)
        return self._serialise()

    def _heads(self, joined: str) -> list[str]:
        """Outputs of the feature maps that a node joins; each is only reshaped on its way."""
        node = self._graph.node(joined)
        if node.op != "ConcatV2":
            raise DetectorError(f"{self._graph.source}: {joined} is a {node.op}, expected a ConcatV2")
        return [self._graph.node(reshaped).inputs[0] for reshaped in node.inputs[:-1]]

    def _serialise(self) -> bytes:
        inputs = [
            helper.make_tensor_value_info("picture", TensorProto.UINT8, ["rows", "columns", "channels"]),
            helper.make_tensor_value_info("order", TensorProto.INT64, [3]),
        ]
        outputs = [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, ["anchors", values])
            for name, (_, values) in OUTPUTS.items()
        ]
        graph = helper.make_graph(self._nodes, "ssd", inputs, outputs, self._constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
        return bytes(model.SerializeToString())

    def add(self, kind: str, inputs: Sequence[str], output: str = "", **attributes: Any) -> str:
        """Add a node with one output and return that output's name."""
        output = output or f"{kind.lower()}_{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    def store(self, value: Any, dtype: Any = np.float32) -> str:
        """Add a constant and return its name."""
        name = f"constant_{len(self._constants)}"
        array = np.array(value, dtype=dtype, order="C")
        self._constants.append(numpy_helper.from_array(array, name))
        return name

    def _stretch(self, size: int) -> str:
        planes = self.add("Transpose", [self.add("Cast", ["picture"], to=TensorProto.FLOAT)], perm=[2, 0, 1])
        batch = self.add("Unsqueeze", [planes, self.store([0], np.int64)])
        options: dict[str, Any] = {"mode": "linear", "coordinate_transformation_mode": "half_pixel", "axes": [2, 3]}
        stretched = self.add("Resize", [batch, "", "", self.store([size, size], np.int64)], **options)
        return self.add("Gather", [self.add("Round", [stretched]), "order"], axis=1)

    def _join(self, heads: list[str], values: int, name: str) -> None:
        shape = self.store([-1, values], np.int64)
        rows = [
            self.add("Reshape", [self.add("Transpose", [self._outputs[head]], perm=[0, 2, 3, 1]), shape])
            for head in heads
        ]
        self.add("Concat", rows, name, axis=0)

    def source(self, node: Node, at: int = 0) -> str:
        """Name of an input that is computed."""
        return self._outputs[node.inputs[at]]

    def constant(self, node: Node, at: int) -> NDArray[Any]:
        """Value of an input that is constant."""
        return self._graph.constant(node.inputs[at])

    def _convolve(self, node: Node, weights: NDArray[Any], groups: int) -> str:
        if node.text("padding") != "SAME" or node.text("data_format") not in ("NHWC", ""):
            raise DetectorError(f"{self._graph.source}: {node.name} is not padded as SAME, or not in the order NHWC")
        strides, dilations = node.integers("strides")[1:3], node.integers("dilations")[1:3] or [1, 1]
        return self.add(
            "Conv",
            [self.source(node), self.store(weights)],
            kernel_shape=list(weights.shape[2:]),
            strides=strides,
            dilations=dilations,
            auto_pad="SAME_UPPER",
            group=groups,
        )

    def convolution(self, node: Node) -> str:
        """Add a convolution; TensorFlow's weights are (rows, columns, in, out)."""
        return self._convolve(node, self.constant(node, 1).transpose(3, 2, 0, 1), 1)

    def depthwise(self, node: Node) -> str:
        """Add a convolution of each channel by itself; TensorFlow's weights are (rows, columns, in, multiplier)."""
        weights = self.constant(node, 1)
        rows, columns, channels, _ = weights.shape
        return self._convolve(node, weights.reshape(rows, columns, 1, -1).transpose(3, 2, 0, 1), channels)

    def batch_norm(self, node: Node) -> str:
        """Add a normalisation by the stored mean and variance."""
        statistics = [self.store(self.constant(node, at)) for at in (1, 2, 3, 4)]
        return self.add("BatchNormalization", [self.source(node), *statistics], epsilon=node.number("epsilon"))

    def relu6(self, node: Node) -> str:
        """Add a clip to 0 to 6."""
        return self.add("Clip", [self.source(node), self.store(0.0), self.store(6.0)])

    def bias(self, node: Node) -> str:
        """Add one number for each channel."""
        return self.add("Add", [self.source(node), self.store(self.constant(node, 1).reshape(1, -1, 1, 1))])

    def sum(self, node: Node) -> str:
        """Add a sum of two earlier results."""
        return self.add("Add", [self.source(node), self.source(node, 1)])

    def scale(self, node: Node) -> str:
        """Add a multiplication; TensorFlow's constant comes first."""
        return self.add("Mul", [self.source(node, 1), self.store(self.constant(node, 0))])

    def subtract(self, node: Node) -> str:
        """Add a subtraction of a constant."""
        return self.add("Sub", [self.source(node), self.store(self.constant(node, 1))])

    def same(self, node: Node) -> str:
        """Add nothing."""
        return self._outputs.get(node.inputs[0], node.inputs[0])


_EMIT: dict[str, Callable[[_Builder, Node], str]] = {
    "Conv2D": _Builder.convolution,
    "DepthwiseConv2dNative": _Builder.depthwise,
    "FusedBatchNorm": _Builder.batch_norm,
    "Relu6": _Builder.relu6,
    "BiasAdd": _Builder.bias,
    "Add": _Builder.sum,
    "Mul": _Builder.scale,
    "Sub": _Builder.subtract,
    "Identity": _Builder.same,
}
