"""The bridge: connections, sessions, and permissions of devices."""
