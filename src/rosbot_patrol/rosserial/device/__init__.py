"""A motion sensor in software, which behaves as the firmware does."""
