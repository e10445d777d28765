"""Seeded random weights for a network, for benchmarks and to compare implementations."""

from __future__ import annotations

import numpy as np

from rosbot_patrol.detection.darknet.layers import Convolutional, NetworkSpec
from rosbot_patrol.detection.darknet.weights import ConvWeights


def random_weights(spec: NetworkSpec, rng: np.random.Generator) -> list[ConvWeights]:
    """Weights that preserve the scale of values from layer to layer, so that boxes of all probabilities result."""
    return [_layer(conv, rng) for conv in spec.convolutions]


def _layer(conv: Convolutional, rng: np.random.Generator) -> ConvWeights:
    filters, channels, size, _ = conv.weights_shape
    weights = rng.normal(0.0, np.sqrt(2.0 / (channels * size * size)), conv.weights_shape).astype(np.float32)
    biases = rng.normal(0.0, 0.1, filters).astype(np.float32)
    if not conv.batch_normalize:
        return ConvWeights(weights=weights, biases=biases)
    return ConvWeights(
        weights=weights,
        biases=biases,
        scales=rng.uniform(0.8, 1.2, filters).astype(np.float32),
        means=rng.normal(0.0, 0.1, filters).astype(np.float32),
        variances=rng.uniform(0.5, 1.5, filters).astype(np.float32),
    )
