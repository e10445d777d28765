"""Run-times of a network: onnxruntime, or OpenCV's dnn if that is not installed."""

from __future__ import annotations

import importlib
import importlib.util
import logging
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.detection.darknet.layers import Convolutional, Head, NetworkSpec
from rosbot_patrol.detection.darknet.letterbox import Letterbox
from rosbot_patrol.detection.darknet.weights import ConvWeights, format_weights
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.images.encodings import Picture

log = logging.getLogger(__name__)


class Network(Protocol):
    """Computes a network up to its heads."""

    @property
    def name(self) -> str:
        """The run-time, for logs."""

    def run(self, picture: Picture, place: Letterbox) -> list[NDArray[np.float32]]:
        """Values before each head, shape (channels, rows, columns), for an 8-bit picture."""


class OnnxNetwork:
    """A network run by onnxruntime, without Python's global lock.

    Args:
        model: a graph from `onnx_build`.
        channels: of the network's input, 1 or 3.
        threads: number of cores it may use.
    """

    def __init__(self, model: bytes, *, channels: int, threads: int) -> None:
        self._session, self.name = open_session(model, threads=threads)
        self._grey = channels == 1

    def run(self, picture: Picture, place: Letterbox) -> list[NDArray[np.float32]]:
        """Values before each head."""
        width, height = place.fitted
        left, top, right, bottom = place.margins
        if self._grey:
            picture = picture.to("mono8")
        inputs = {
            "picture": picture.pixels,
            "size": np.array([1, picture.pixels.shape[2], height, width], dtype=np.int64),
            "pads": np.array([0, 0, top, left, 0, 0, bottom, right], dtype=np.int64),
            "gains": place.row_gains.reshape(1, 1, height, 1) / np.float32(255.0),
            "order": np.array(picture.order[:1] if self._grey else picture.order, dtype=np.int64),
        }
        return [values[0] for values in self._session.run(None, inputs)]


def open_session(model: bytes, *, threads: int) -> tuple[Any, str]:
    """Open an ONNX graph in onnxruntime, which has to be installed.

    Args:
        model: the serialised graph.
        threads: number of cores it may use.

    Returns:
        The session, and the run-time's name for logs.
    """
    runtime = importlib.import_module("onnxruntime")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # let waiting threads sleep: the other programs need the robot's two cores
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    session = runtime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    return session, f"onnxruntime {runtime.__version__}"


class CvNetwork:
    """A network run by OpenCV's dnn, several times slower.

    Args:
        cv2: the module.
        spec: the network; `weights` are the bytes of its weights file.

    Raises:
        DetectorError: OpenCV cannot compute this network.
    """

    def __init__(self, cv2: Any, spec: NetworkSpec, weights: bytes) -> None:
        cfg = np.frombuffer(spec.text.encode(), dtype=np.uint8)
        try:
            self._net = cv2.dnn.readNetFromDarknet(cfg, np.frombuffer(weights, dtype=np.uint8))
        except cv2.error as err:
            raise DetectorError(f"{spec.source}: OpenCV cannot compute this network: {err}") from err
        self._before_heads = [_cv_name(spec, head) for head in spec.heads]
        self._encoding = "mono8" if spec.channels == 1 else "rgb8"
        self.name = f"OpenCV {cv2.__version__} dnn"

    def run(self, picture: Picture, place: Letterbox) -> list[NDArray[np.float32]]:
        """Values before each head."""
        self._net.setInput(place.draw(picture.to(self._encoding).pixels)[None])
        return [values[0] for values in self._net.forward(self._before_heads)]


def _cv_name(spec: NetworkSpec, head: Head) -> str:
    """OpenCV's name of the layer before a head; its own decoding differs from darknet's and is not used."""
    before = spec.layers[head.index - 1] if head.index else None
    if not isinstance(before, Convolutional):
        raise DetectorError(f"{spec.source}, line {head.line}: OpenCV needs a convolution before it")
    kind = "conv" if before.activation == "linear" else before.activation
    return f"{kind}_{before.index}"


def load_network(spec: NetworkSpec, weights: Sequence[ConvWeights], *, threads: int = 1) -> Network:
    """Make a network ready to run, on the best available run-time.

    Raises:
        DetectorError: no run-time is installed.
    """
    if spec.channels not in (1, 3):
        raise DetectorError(f"{spec.source}: takes {spec.channels} channels, pictures have 1 or 3")
    if importlib.util.find_spec("onnxruntime") is not None:
        builder = importlib.import_module("rosbot_patrol.detection.darknet.onnx_build")
        return OnnxNetwork(builder.build_model(spec, weights), channels=spec.channels, threads=threads)
    if importlib.util.find_spec("cv2") is None:
        raise DetectorError("neither onnxruntime nor OpenCV (cv2) is installed, so no network can be computed")
    log.warning("onnxruntime is not installed: OpenCV computes the network, several times slower")
    return CvNetwork(importlib.import_module("cv2"), spec, format_weights(spec, weights))
