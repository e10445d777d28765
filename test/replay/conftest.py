"""Our own bags as tests, by the plugin that users have; `pytest test/replay --replay-record` refreshes them."""

from rosbot_patrol.replay.pytest_plugin import pytest_addoption as pytest_addoption
from rosbot_patrol.replay.pytest_plugin import pytest_collect_file as pytest_collect_file
