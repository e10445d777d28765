"""Frontier exploration: where a robot without a map drives next."""
