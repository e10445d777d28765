"""The bridge: connections, sessions, what each device may do."""
