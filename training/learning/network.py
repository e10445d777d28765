"""A darknet network as a PyTorch module, built from the cfg file's layers: what is trained is what is shipped."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from rosbot_patrol.detection.darknet.layers import (
    Convolutional,
    Layer,
    Maxpool,
    NetworkSpec,
    Route,
    Shortcut,
    Upsample,
    Yolo,
)
from rosbot_patrol.detection.darknet.weights import ConvWeights
from rosbot_patrol.errors import DetectorError

_ACTIVATIONS: dict[str, Callable[[], nn.Module]] = {
    "leaky": lambda: nn.LeakyReLU(0.1, inplace=True),
    "linear": nn.Identity,
}
_EPSILON = 1e-5


class Darknet(nn.Module):
    """Gives the raw values of each [yolo] head, shape (batch, anchors * (5 + classes), rows, columns)."""

    def __init__(self, spec: NetworkSpec) -> None:
        super().__init__()
        self.spec = spec
        self.blocks = nn.ModuleList(_block(layer) for layer in spec.layers)

    def forward(self, pictures: torch.Tensor) -> list[torch.Tensor]:
        """Values of the heads for pictures of shape (batch, 3, height, width), 0 to 1."""
        outputs: list[torch.Tensor] = []
        heads = []
        value = pictures
        for layer, block in zip(self.spec.layers, self.blocks, strict=True):
            if isinstance(layer, Route):
                value = torch.cat([outputs[i] for i in layer.layers], dim=1)
            elif isinstance(layer, Shortcut):
                value = value + outputs[layer.layers[0]]
            else:
                value = block(value)
            if isinstance(layer, Yolo):
                heads.append(value)
            outputs.append(value)
        return heads

    def to_weights(self) -> list[ConvWeights]:
        """The numbers of each convolution, as darknet's file holds them."""
        return [_weights(block) for layer, block in self._convolutions()]

    def from_weights(self, weights: list[ConvWeights]) -> None:
        """Take numbers of a weights file."""
        for (_, block), numbers in zip(self._convolutions(), weights, strict=True):
            _load(block, numbers)

    def set_prior(self, probability: float) -> None:
        """Begin with that objectness everywhere: almost every cell is empty."""
        for layer, before in zip(self.spec.layers[1:], self.blocks, strict=False):
            if isinstance(layer, Yolo):
                bias = before[0].bias.view(len(layer.anchors), -1)
                with torch.no_grad():
                    bias[:, 4] = float(np.log(probability / (1 - probability)))

    def _convolutions(self) -> list[tuple[Layer, nn.Module]]:
        pairs = zip(self.spec.layers, self.blocks, strict=True)
        return [(layer, block) for layer, block in pairs if isinstance(layer, Convolutional)]


def _block(layer: Layer) -> nn.Module:
    if isinstance(layer, Convolutional):
        if layer.activation not in _ACTIVATIONS:
            raise DetectorError(f"line {layer.line}: activation {layer.activation} cannot be trained here")
        plain = nn.Conv2d(
            layer.in_shape[0],
            layer.filters,
            layer.size,
            layer.stride,
            layer.padding,
            groups=layer.groups,
            bias=not layer.batch_normalize,
        )
        norm = [nn.BatchNorm2d(layer.filters, eps=_EPSILON, momentum=0.03)] if layer.batch_normalize else []
        return nn.Sequential(plain, *norm, _ACTIVATIONS[layer.activation]())
    if isinstance(layer, Maxpool):
        return nn.MaxPool2d(layer.size, layer.stride, (layer.size - 1) // 2)
    if isinstance(layer, Upsample):
        return nn.Upsample(scale_factor=layer.stride, mode="nearest")
    if isinstance(layer, Route | Shortcut | Yolo):
        return nn.Identity()
    raise DetectorError(f"line {layer.line}: a layer of kind {type(layer).__name__} cannot be trained here")


def _weights(block: Any) -> ConvWeights:
    plain = block[0]
    if not isinstance(block[1], nn.BatchNorm2d):
        return ConvWeights(weights=_array(plain.weight), biases=_array(plain.bias))
    norm = block[1]
    # PyTorch divides by sqrt(variance + epsilon), darknet by sqrt(variance) + 1e-6
    variances = (np.sqrt(_array(norm.running_var).astype(np.float64) + _EPSILON) - 1e-6) ** 2
    return ConvWeights(
        weights=_array(plain.weight),
        biases=_array(norm.bias),
        scales=_array(norm.weight),
        means=_array(norm.running_mean),
        variances=variances.astype(np.float32),
    )


def _load(block: Any, numbers: ConvWeights) -> None:
    plain = block[0]
    with torch.no_grad():
        plain.weight.copy_(torch.from_numpy(numbers.weights.copy()))
        if numbers.scales is None or numbers.means is None or numbers.variances is None:
            plain.bias.copy_(torch.from_numpy(numbers.biases.copy()))
            return
        norm = block[1]
        norm.bias.copy_(torch.from_numpy(numbers.biases.copy()))
        norm.weight.copy_(torch.from_numpy(numbers.scales.copy()))
        norm.running_mean.copy_(torch.from_numpy(numbers.means.copy()))
        variances = (np.sqrt(numbers.variances.astype(np.float64)) + 1e-6) ** 2 - _EPSILON
        norm.running_var.copy_(torch.from_numpy(np.maximum(variances, 0.0).astype(np.float32)))


def _array(tensor: torch.Tensor) -> NDArray[Any]:
    values: NDArray[Any] = tensor.detach().cpu().numpy().astype(np.float32)
    return values
