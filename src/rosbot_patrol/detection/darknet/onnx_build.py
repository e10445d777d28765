"""Builder of an ONNX graph that computes the same as darknet, from a network and its weights.

The graph takes an unscaled picture (uint8, rows, columns, channels) and fits it into the network's input as darknet's
letterbox does. Its bilinear rule keeps the corner pixels' centres, which ONNX calls `align_corners`; the border is grey
0.5. The outputs are the values before each head; `decode` converts them to boxes.

Inputs besides the picture: `size` (1, channels, rows, columns of the fitted picture), `pads` (as in ONNX Pad: the cells
around it), `gains` (the factor of each fitted row, usually 1 / 255) and `order` (indices of the picture's red, green
and blue channels). So one graph serves pictures of every size and encoding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from rosbot_patrol.detection.darknet.layers import (
    Convolutional,
    Dropout,
    Head,
    Layer,
    Maxpool,
    NetworkSpec,
    Reorg,
    Route,
    Shortcut,
    Upsample,
)
from rosbot_patrol.detection.darknet.weights import ConvWeights

OPSET = 17
IR_VERSION = 8
LEAKY_SLOPE = 0.1
GREY = 0.5


def build_model(spec: NetworkSpec, weights: Sequence[ConvWeights]) -> bytes:
    """Build the serialised graph of a network; its outputs are "head0", "head1", ... in the order of `spec.heads`."""
    return _Graph(spec).build(list(weights))


class _Graph:
    """A graph under construction: nodes, constants, and the name of each layer's output."""

    def __init__(self, spec: NetworkSpec) -> None:
        self._spec = spec
        self._nodes: list[onnx.NodeProto] = []
        self._constants: list[onnx.TensorProto] = []
        self._outputs: list[str] = []
        self._weights: list[ConvWeights] = []

    def build(self, weights: list[ConvWeights]) -> bytes:
        self._weights = weights[::-1]
        name = self._letterbox()
        heads = []
        for layer in self._spec.layers:
            if isinstance(layer, Head):
                heads.append((name, layer))
            else:
                name = _EMIT[type(layer)](self, layer, name)
            self._outputs.append(name)
        for i, (source, _) in enumerate(heads):
            self._nodes.append(helper.make_node("Identity", [source], [f"head{i}"]))
        return self._serialise([head for _, head in heads])

    def _serialise(self, heads: list[Head]) -> bytes:
        inputs = [
            helper.make_tensor_value_info("picture", TensorProto.UINT8, ["rows", "columns", "channels"]),
            helper.make_tensor_value_info("size", TensorProto.INT64, [4]),
            helper.make_tensor_value_info("pads", TensorProto.INT64, [8]),
            helper.make_tensor_value_info("gains", TensorProto.FLOAT, [1, 1, "fitted_rows", 1]),
            helper.make_tensor_value_info("order", TensorProto.INT64, [self._spec.channels]),
        ]
        outputs = [
            helper.make_tensor_value_info(f"head{i}", TensorProto.FLOAT, [1, *head.in_shape])
            for i, head in enumerate(heads)
        ]
        graph = helper.make_graph(self._nodes, "darknet", inputs, outputs, self._constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
        return bytes(model.SerializeToString())

    def node(self, kind: str, inputs: list[str], **attributes: Any) -> str:
        """Add a node with one output and return that output's name."""
        output = f"{kind.lower()}_{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    def constant(self, value: Any, dtype: Any) -> str:
        """Add a constant and return its name."""
        name = f"constant_{len(self._constants)}"
        self._constants.append(
            numpy_helper.from_array(np.ascontiguousarray(value, dtype=dtype).reshape(np.shape(value)), name)
        )
        return name

    def activate(self, name: str, source: str) -> str:
        """Add one of darknet's activations."""
        if name == "linear":
            return source
        if name == "leaky":
            return self.node("LeakyRelu", [source], alpha=LEAKY_SLOPE)
        if name == "mish":
            return self.node("Mul", [source, self.node("Tanh", [self.node("Softplus", [source])])])
        if name == "swish":
            return self.node("Mul", [source, self.node("Sigmoid", [source])])
        return self.node({"logistic": "Sigmoid", "relu": "Relu", "tanh": "Tanh"}[name], [source])

    def _letterbox(self) -> str:
        spec = self._spec
        planes = self.node("Transpose", [self.node("Cast", ["picture"], to=TensorProto.FLOAT)], perm=[2, 0, 1])
        batch = self.node("Unsqueeze", [planes, self.constant([0], np.int64)])
        options = {"mode": "linear", "coordinate_transformation_mode": "align_corners"}
        fitted = self.node("Resize", [batch, "", "", "size"], **options)
        ordered = self.node("Gather", [fitted, "order"], axis=1)
        scaled = self.node("Mul", [ordered, "gains"])
        padded = self.node("Pad", [scaled, "pads", self.constant(GREY, np.float32)])
        shape = self.constant([1, spec.channels, spec.height, spec.width], np.int64)
        return self.node("Reshape", [padded, shape])  # sets the size, so that the rest of the graph has fixed shapes

    def convolutional(self, layer: Convolutional, source: str) -> str:
        """Add a convolution with folded batch normalisation."""
        weights, biases = self._weights.pop().folded()
        convolved = self.node(
            "Conv",
            [source, self.constant(weights, np.float32), self.constant(biases, np.float32)],
            kernel_shape=[layer.size] * 2,
            strides=[layer.stride] * 2,
            pads=[layer.padding] * 4,
            group=layer.groups,
        )
        return self.activate(layer.activation, convolved)

    def maxpool(self, layer: Maxpool, source: str) -> str:
        """Add a maxpool; darknet pads half (rounded down) before the picture and the rest after it."""
        before = layer.padding // 2
        after = layer.padding - before
        return self.node(
            "MaxPool",
            [source],
            kernel_shape=[layer.size] * 2,
            strides=[layer.stride] * 2,
            pads=[before, before, after, after],
        )

    def route(self, layer: Route, _: str) -> str:
        """Add a concatenation of (parts of) earlier layers."""
        parts = [self._part(i, layer.groups, layer.group_id) for i in layer.layers]
        return parts[0] if len(parts) == 1 else self.node("Concat", parts, axis=1)

    def _part(self, index: int, groups: int, group_id: int) -> str:
        if groups == 1:
            return self._outputs[index]
        width = self._spec.layers[index].out_shape[0] // groups
        bounds = [self.constant([n], np.int64) for n in (width * group_id, width * (group_id + 1), 1)]
        return self.node("Slice", [self._outputs[index], *bounds])

    def shortcut(self, layer: Shortcut, source: str) -> str:
        """Add a sum with earlier layers."""
        for index in layer.layers:
            source = self.node("Add", [source, self._outputs[index]])
        return self.activate(layer.activation, source)

    def upsample(self, layer: Upsample, source: str) -> str:
        """Add an upsampling to the nearest cell."""
        scales = self.constant([1, 1, layer.stride, layer.stride], np.float32)
        rule = {"mode": "nearest", "coordinate_transformation_mode": "asymmetric", "nearest_mode": "floor"}
        grown = self.node("Resize", [source, "", scales], **rule)
        return grown if layer.scale == 1.0 else self.node("Mul", [grown, self.constant(layer.scale, np.float32)])

    def reorg(self, layer: Reorg, source: str) -> str:
        """Add a reorg; darknet reads (c, h, w) as (c / s2, h * s, w * s) before it folds s x s cells into channels."""
        (c, h, w), s = layer.in_shape, layer.stride
        read = self.node("Reshape", [source, self.constant([c // (s * s), h, s, w, s], np.int64)])
        folded = self.node("Transpose", [read], perm=[2, 4, 0, 1, 3])
        return self.node("Reshape", [folded, self.constant([1, *layer.out_shape], np.int64)])

    def dropout(self, _: Dropout, source: str) -> str:
        """Add nothing: dropout has no effect at run time."""
        return source


_EMIT: dict[type[Layer], Callable[[_Graph, Any, str], str]] = {
    Convolutional: _Graph.convolutional,
    Maxpool: _Graph.maxpool,
    Route: _Graph.route,
    Shortcut: _Graph.shortcut,
    Upsample: _Graph.upsample,
    Reorg: _Graph.reorg,
    Dropout: _Graph.dropout,
}
