"""Our own bags as tests, through the users' plugin. To refresh the expected results:

pytest -p rosbot_patrol.replay.pytest_plugin test/replay --replay-record
"""

import pytest

PLUGIN = "rosbot_patrol.replay.pytest_plugin"


def pytest_configure(config: pytest.Config) -> None:
    if not config.pluginmanager.has_plugin(PLUGIN):
        config.pluginmanager.import_plugin(PLUGIN)
