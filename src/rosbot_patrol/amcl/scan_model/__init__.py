"""How well a scan fits the map at a pose."""
