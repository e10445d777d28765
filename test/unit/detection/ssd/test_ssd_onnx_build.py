"""The ONNX graph computes what TensorFlow's operations are documented to compute, here written out in numpy."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest
from small_graph import GraphWriter, small_graph, weights

from rosbot_patrol.detection.ssd.graph_def import read_graph
from rosbot_patrol.detection.ssd.onnx_build import build_model
from rosbot_patrol.errors import DetectorError

SIZE = 6


def convolve(picture: np.ndarray, kernel: np.ndarray, stride: int) -> np.ndarray:
    """TensorFlow's SAME: the output has ceil(size / stride) cells, the odd pixel of padding comes last."""
    size, cells = len(picture), -(-len(picture) // stride)
    total = max((cells - 1) * stride + len(kernel) - size, 0)
    padded = np.pad(picture, ((total // 2, total - total // 2),) * 2 + ((0, 0),))
    out = np.zeros((cells, cells, kernel.shape[3]))
    for row, column in np.ndindex(cells, cells):
        window = padded[row * stride :, column * stride :][: len(kernel), : len(kernel)]
        out[row, column] = np.einsum("hwi,hwio->o", window, kernel)
    return out


def expected(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    w = weights()
    values = convolve(picture * w["mul/x"] - w["sub/y"], w["w"], 2)
    values = (values - w["mean"]) / np.sqrt(w["variance"] + 0.001) * w["gamma"] + w["beta"]
    relu = np.clip(values, 0.0, 6.0)
    alone = [convolve(relu[..., i : i + 1], w["dw"][:, :, i : i + 1], 1) for i in range(relu.shape[2])]
    total = np.concatenate(alone, axis=2) + relu
    boxes = (total @ w["boxes/w"][0, 0] + w["boxes/b"]).reshape(-1, 4)
    classes = (total @ w["classes/w"][0, 0] + w["classes/b"]).reshape(-1, 2)
    return np.tile(boxes, (2, 1)), np.tile(classes, (2, 1))


def run(picture: np.ndarray, order: tuple[int, ...] = (0, 1, 2)) -> tuple[np.ndarray, np.ndarray]:
    model = build_model(read_graph(small_graph(), "small.pb"), size=SIZE)
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    encodings, logits = session.run(
        ["encodings", "logits"], {"picture": picture, "order": np.array(order, dtype=np.int64)}
    )
    return encodings, logits


def test_every_operation() -> None:
    picture = np.random.default_rng(2).integers(0, 256, (SIZE, SIZE, 3), dtype=np.uint8)
    for got, wanted in zip(run(picture), expected(picture.astype(np.float64)), strict=True):
        assert got.shape == wanted.shape
        assert np.abs(got - wanted).max() < 1e-5


@pytest.mark.parametrize(("order", "channels"), [((2, 1, 0), 3), ((0, 1, 2), 4), ((0, 0, 0), 1)])
def test_channels_of_any_encoding(order: tuple[int, ...], channels: int) -> None:
    picture = np.random.default_rng(3).integers(0, 256, (SIZE, SIZE, channels), dtype=np.uint8)
    rgb = np.ascontiguousarray(picture[:, :, list(order)])
    for got, wanted in zip(run(picture, order), run(rgb), strict=True):
        assert np.array_equal(got, wanted)


def test_a_picture_is_stretched_with_half_pixel_centres() -> None:
    row = np.array([0, 30, 60, 90, 120, 150, 180, 210, 240, 250, 10, 70], dtype=np.uint8)
    wide = np.tile(row[None, :, None], (SIZE, 1, 3))
    half = ((row[0::2].astype(int) + row[1::2]) // 2).astype(np.uint8)
    for got, wanted in zip(run(wide), run(np.tile(half[None, :, None], (SIZE, 1, 3))), strict=True):
        assert np.abs(got - wanted).max() < 1e-5


def test_an_unknown_operation_is_said() -> None:
    data = small_graph().replace(b"Relu6", b"Relu7")
    with pytest.raises(DetectorError, match=r"small\.pb: the operation Relu7 \(relu\) is not known here"):
        build_model(read_graph(data, "small.pb"), size=SIZE)


@pytest.mark.parametrize("change", [{"padding": "VALID"}, {"data_format": "NCHW"}])
def test_another_padding_or_order_is_said(change: dict[str, str]) -> None:
    with pytest.raises(DetectorError, match="conv is not padded as SAME, or not in the order NHWC"):
        build_model(read_graph(small_graph(**change), "small.pb"), size=SIZE)


def test_another_network_is_said() -> None:
    write = GraphWriter()
    write.node("concat", "Add")
    with pytest.raises(DetectorError, match="concat is a Add, expected a ConcatV2"):
        build_model(read_graph(write.message.SerializeToString(), "x.pb"), size=SIZE)
