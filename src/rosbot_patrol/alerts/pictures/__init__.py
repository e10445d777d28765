"""Pictures of an incident: the last seconds of the camera, the album, the map."""
