"""rosserial: framing and negotiation as pure state machines, and a small server and device over real links."""
