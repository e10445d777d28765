"""The log in the background: nobody waits for it, and what is left out is told."""

import logging
import threading

import pytest

logs = pytest.importorskip("rosbot_patrol.ros.logs", reason="needs ROS: source the workspace first")


class _Slow(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self.taken, self.go_on = threading.Event(), threading.Event()

    def emit(self, record: logging.LogRecord) -> None:
        self.taken.set()
        self.go_on.wait(10.0)
        self.lines.append(record.getMessage())


@pytest.fixture
def slow():
    """The only handler of the package for a while."""
    package, handler = logging.getLogger("rosbot_patrol"), _Slow()
    before, level = package.handlers[:], package.level
    package.handlers[:] = [handler]
    package.setLevel(logging.INFO)
    yield handler
    package.handlers[:] = before
    package.setLevel(level)


def test_lines_come_in_order_and_what_is_left_out_is_told(slow: _Slow, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "WAITING", 3)
    log = logging.getLogger("rosbot_patrol.test")
    with logs.in_background():
        log.info("first")
        assert slow.taken.wait(10.0)
        for number in range(5):  # three wait, two find no room
            log.info("line %d of 100%%", number)
        slow.go_on.set()
        for _ in range(100):
            if len(slow.lines) == 4:
                break
            threading.Event().wait(0.05)
        log.info("last")
    assert slow.lines == [
        "first",
        "line 0 of 100%",
        "line 1 of 100%",
        "line 2 of 100%",
        "last (2 lines before this were left out)",
    ]
