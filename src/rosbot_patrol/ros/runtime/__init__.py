"""Common parts of all nodes: start and end, inputs, logs, diagnostics, transforms, files."""
