"""Darknet's files and arithmetic: cfg, weights, decoding, an ONNX graph of the same."""
