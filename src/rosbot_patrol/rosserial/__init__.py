"""The protocol of the motion sensors: pure state machines, a server, a device."""
