"""A network of two layers, for tests of what trains networks."""

from __future__ import annotations


def small_cfg(width: int = 64, height: int = 32, stride: int = 2, anchors: str = "10,20") -> str:
    """Its cfg: one [yolo] head with one anchor and two classes."""
    return f"""
[net]
width={width}
height={height}
channels=3
[convolutional]
batch_normalize=1
filters=4
size=3
stride={stride}
pad=1
activation=leaky
[convolutional]
filters=7
size=1
activation=linear
[yolo]
mask=0
anchors={anchors}
classes=2
num=1
"""
