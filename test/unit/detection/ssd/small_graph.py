"""A small frozen graph with one of each operation of an SSD, as bytes of a GraphDef."""

from __future__ import annotations

from typing import Any

import numpy as np

from rosbot_patrol.detection.ssd.graph_def import GraphMessage
from rosbot_patrol.detection.ssd.onnx_build import INPUT

CHANNELS = 4


class GraphWriter:
    """Writes nodes with the fields that TensorFlow uses."""

    def __init__(self) -> None:
        self.message = GraphMessage()

    def node(self, name: str, op: str, *inputs: str, **attributes: Any) -> None:
        node = self.message.node.add(name=name, op=op, input=inputs)
        for key, value in attributes.items():
            attribute = node.attr.add(key=key).value
            if isinstance(value, str):
                attribute.s = value.encode()
            elif isinstance(value, float):
                attribute.f = value
            else:
                attribute.list.i.extend(value)

    def constant(self, name: str, value: Any) -> None:
        array = np.asarray(value, dtype=np.float32)
        tensor = self.message.node.add(name=name, op="Const").attr.add(key="value").value.tensor
        tensor.dtype = 1
        for size in array.shape:
            tensor.tensor_shape.dim.add(size=size)
        if array.ndim:
            tensor.tensor_content = array.tobytes()
        else:
            tensor.float_val.append(float(array))


def weights() -> dict[str, np.ndarray]:
    """Constants of the small graph."""
    rng = np.random.default_rng(5)

    def draw(*shape: int) -> np.ndarray:
        return rng.normal(0.0, 0.5, shape).astype(np.float32)

    return {
        "mul/x": np.float32(2.0 / 255.0),
        "sub/y": np.float32(1.0),
        "w": draw(3, 3, 3, CHANNELS),
        "gamma": draw(CHANNELS),
        "beta": draw(CHANNELS),
        "mean": draw(CHANNELS),
        "variance": draw(CHANNELS) ** 2 + 0.1,
        "dw": draw(3, 3, CHANNELS, 1),
        "boxes/w": draw(1, 1, CHANNELS, 8),
        "boxes/b": draw(8),
        "classes/w": draw(1, 1, CHANNELS, 4),
        "classes/b": draw(4),
    }


def small_graph(**changes: Any) -> bytes:
    """Bytes of the graph; two anchors a cell, one feature map, given twice. `changes` are attributes of `conv`."""
    write = GraphWriter()
    for name, value in weights().items():
        write.constant(name, value)
        write.node(f"{name}/read", "Identity", name)
    same: dict[str, Any] = {"padding": "SAME", "data_format": "NHWC"}
    write.node(INPUT, "TensorArrayGatherV3", "no such thing")
    write.node("mul", "Mul", "mul/x", INPUT)
    write.node("sub", "Sub", "mul", "sub/y")
    write.node("conv", "Conv2D", "sub", "w/read", **{**same, "strides": [1, 2, 2, 1], **changes})
    statistics = ("gamma/read", "beta/read", "mean/read", "variance/read")
    write.node("norm", "FusedBatchNorm", "conv", *statistics, epsilon=0.001)
    write.node("relu", "Relu6", "norm")
    write.node("depthwise", "DepthwiseConv2dNative", "relu", "dw/read", strides=[1, 1, 1, 1], **same)
    write.node("out", "Identity", "depthwise")
    write.node("sum", "Add", "out", "relu")
    for head in ("boxes", "classes"):
        write.node(f"{head}/conv", "Conv2D", "sum", f"{head}/w/read", strides=[1, 1, 1, 1], **same)
        write.node(f"{head}/bias", "BiasAdd", f"{head}/conv", f"{head}/b/read")
        write.node(f"{head}/reshape", "Reshape", f"{head}/bias")
    write.node("axis", "Const")
    write.node("concat", "ConcatV2", "boxes/reshape", "boxes/reshape", "axis")
    write.node("concat_1", "ConcatV2", "classes/reshape", "classes/reshape", "axis")
    data: bytes = write.message.SerializeToString()
    return data
