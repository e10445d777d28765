"""The nodes map_server and map_saver."""
