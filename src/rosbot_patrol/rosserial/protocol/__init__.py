"""Bytes of rosserial: framing, topic negotiation, keys."""
