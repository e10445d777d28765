"""Reader and writer of darknet's weights files.

A file has a header of three int32 (major, minor, revision) and the number of training pictures (8 bytes since version
0.2, 4 before). Then come the float32 values of each convolution in order: biases; with batch normalisation scales,
means and variances; weights by filter, channel, row, column.

Differs: darknet reads whatever is there; here a file that is shorter or longer than the network needs is an error with
both sizes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rosbot_patrol.detection.darknet.layers import Convolutional, NetworkSpec
from rosbot_patrol.errors import DetectorError


@dataclass(frozen=True, kw_only=True)
class ConvWeights:
    """Weights of one convolution, float32.

    Args:
        weights: shape (filters, channels of a group, rows, columns).
        biases: shape (filters,).
        scales: of batch normalisation, shape (filters,); None without it, as are `means` and `variances`.
    """

    weights: NDArray[np.float32]
    biases: NDArray[np.float32]
    scales: NDArray[np.float32] | None = None
    means: NDArray[np.float32] | None = None
    variances: NDArray[np.float32] | None = None

    def folded(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Weights and biases with folded batch normalisation; darknet divides by sqrt(variance) + 1e-6."""
        if self.scales is None or self.means is None or self.variances is None:
            return self.weights, self.biases
        gain = self.scales.astype(np.float64) / (np.sqrt(self.variances.astype(np.float64)) + 1e-6)
        weights = self.weights * gain[:, None, None, None].astype(np.float32)
        return weights, (self.biases - self.means * gain).astype(np.float32)


def weights_size(spec: NetworkSpec) -> int:
    """Size of this network's weights file [bytes], in the present format."""
    return 20 + 4 * spec.parameters


def parse_weights(data: bytes, spec: NetworkSpec, source: str = "weights") -> list[ConvWeights]:
    """Weights of each convolution of `spec`, in order, as read-only views of `data`.

    Raises:
        DetectorError: the file has the wrong size for the network; names both sizes.
    """
    if len(data) < 16:
        raise DetectorError(f"{source}: has {len(data)} bytes, {spec.source} needs {weights_size(spec)}")
    major, minor = struct.unpack_from("<2i", data)
    header = 20 if major * 10 + minor >= 2 and 0 <= major < 1000 and 0 <= minor < 1000 else 16
    needed = header + 4 * spec.parameters
    if len(data) != needed:
        what = "is cut short" if len(data) < needed else "is too long, it belongs to another network"
        raise DetectorError(f"{source} {what}: it has {len(data)} bytes, {spec.source} needs {needed}")
    if major > 1000 or minor > 1000:
        raise DetectorError(f"{source}: is of version {major}.{minor} (transposed weights), which is not supported")
    numbers = np.frombuffer(data, dtype="<f4", offset=header)
    if not np.isfinite(numbers).all():
        bad = header + 4 * int(np.flatnonzero(~np.isfinite(numbers))[0])
        raise DetectorError(f"{source}: the number at byte {bad} is not finite, the file is damaged")
    return _split(numbers, spec.convolutions)


def read_weights(path: str, spec: NetworkSpec) -> list[ConvWeights]:
    """Read a weights file; DetectorError as in `parse_weights`, or with what to do if it cannot be read."""
    try:
        with open(path, "rb") as file:
            data = file.read()
    except FileNotFoundError as err:
        size = weights_size(spec)
        raise DetectorError(
            f"the weights file {path} is not there: put the file of {size:,} bytes that goes with {spec.source} there"
        ) from err
    except OSError as err:
        raise DetectorError(f"the weights file {path} cannot be read: {err.strerror}") from err
    return parse_weights(data, spec, path)


def format_weights(spec: NetworkSpec, layers: Iterable[ConvWeights], *, seen: int = 0, bits: int = 23) -> bytes:
    """Bytes of a weights file (version 0.2) from the weights of each convolution.

    Args:
        spec: the network.
        layers: weights of its convolutions.
        seen: number of training pictures.
        bits: kept bits of each fraction, of 23: with 10 (half precision) the file compresses to three fifths.

    Raises:
        DetectorError: the numbers do not fit the network; names the layer.
    """
    parts = [struct.pack("<3iQ", 0, 2, 0, seen)]
    given, wanted = list(layers), spec.convolutions
    if len(given) != len(wanted):
        raise DetectorError(f"{spec.source}: has {len(wanted)} convolutions, got weights of {len(given)}")
    for conv, numbers in zip(wanted, given, strict=True):
        parts.extend(_rounded(array, bits).tobytes() for array in _checked(conv, numbers, spec.source))
    return b"".join(parts)


def _rounded(array: NDArray[np.float32], bits: int) -> NDArray[np.float32]:
    """Numbers rounded so that their last bits are zero."""
    gone = 23 - bits
    if not gone:
        return array
    whole = array.view(np.uint32).astype(np.uint64) + (1 << (gone - 1))
    return (whole >> gone << gone).astype("<u4").view("<f4")


def _checked(conv: Convolutional, numbers: ConvWeights, source: str) -> Iterable[NDArray[np.float32]]:
    arrays: dict[str, NDArray[np.float32] | None] = {"biases": numbers.biases}
    if conv.batch_normalize:
        arrays |= {"scales": numbers.scales, "means": numbers.means, "variances": numbers.variances}
    arrays["weights"] = numbers.weights
    for name, array in arrays.items():
        shape = conv.weights_shape if name == "weights" else (conv.filters,)
        got = None if array is None else np.shape(array)
        if got != shape:
            raise DetectorError(f"{source}, line {conv.line}: layer {conv.index} needs {name} {shape}, got {got}")
        assert array is not None
        yield np.ascontiguousarray(array, dtype="<f4")


def _split(numbers: NDArray[np.float32], convolutions: list[Convolutional]) -> list[ConvWeights]:
    layers, at = [], 0

    def take(count: int) -> NDArray[np.float32]:
        nonlocal at
        at += count
        return numbers[at - count : at]

    for conv in convolutions:
        fields = {"biases": take(conv.filters)}
        if conv.batch_normalize:
            fields |= {name: take(conv.filters) for name in ("scales", "means", "variances")}
        shape = conv.weights_shape
        layers.append(ConvWeights(**fields, weights=take(int(np.prod(shape))).reshape(shape)))
    return layers
