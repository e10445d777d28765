"""What every node shares: start and end, inputs, logs, diagnostics, transforms, files."""
