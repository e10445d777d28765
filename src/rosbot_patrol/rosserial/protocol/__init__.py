"""The bytes of rosserial: framing, topic negotiation, keys."""
