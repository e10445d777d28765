"""The network as PyTorch has it, its loss, and the training."""
