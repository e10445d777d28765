"""The machine that the guard runs on: its open ports, who may reach them, and the service that keeps it running."""
