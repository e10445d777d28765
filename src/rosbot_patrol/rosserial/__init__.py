"""rosserial, the protocol of the motion sensors: protocol state machines, a server, a device."""
