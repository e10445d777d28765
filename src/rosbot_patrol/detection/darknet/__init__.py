"""Darknet's files and arithmetic: cfg, weights, decoding, and an equivalent ONNX graph."""
