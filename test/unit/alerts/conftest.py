from incidents import envelope, make_incident, quick_disk  # noqa: F401 -- fixtures
