"""Detailed people: one smooth surface over a skeleton, with clothes, face, hair, hands and shoes."""
