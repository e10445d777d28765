"""Places that are seen again: the search for where a scan fits a map, without a good guess."""
