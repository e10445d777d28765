"""A motion sensor in software, as its firmware speaks."""
