"""One roscore for all system tests; each test launches its own house on it."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

# A shell's background job starts with SIGINT ignored, and so would every node: each would have to be killed.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


# What needs the machine's speed comes first; the last are houses whose clock waits for their nodes.
ORDER = ("test_tutorial", "test_two_machines", "test_kills", "test_hardware", "test_two_guards", "test_orders")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the files: see ORDER."""
    items.sort(key=lambda item: ORDER.index(item.path.stem) if item.path.stem in ORDER else len(ORDER))


@pytest.fixture(scope="session")
def master(tmp_path_factory: pytest.TempPathFactory) -> Iterator[object]:
    house = pytest.importorskip(
        "rosbot_patrol.ros.campaign.house", reason="the workspace is not on the path: `. scripts/env`"
    )
    running = house.Master(tmp_path_factory.mktemp("master") / "roscore.log")
    yield running
    running.stop()


@pytest.fixture
def folder(master: object, tmp_path: Path) -> Path:
    """A folder of its own, and a parameter server that knows nothing of the house before."""
    import rospy

    kept = {"rosdistro", "rosversion", "run_id", "roslaunch", "use_sim_time"}
    for name in set(rospy.get_param("/")) - kept:  # whole trees: each call takes a while on a busy machine
        with contextlib.suppress(KeyError):  # a node of before may have taken it back meanwhile
            rospy.delete_param(f"/{name}")
    return tmp_path
