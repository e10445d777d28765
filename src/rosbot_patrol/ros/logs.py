"""Bring the records of the pure modules (`logging.getLogger("rosbot_patrol...")`) to the console and /rosout."""

from __future__ import annotations

import contextlib
import logging
import logging.handlers
import queue
from collections.abc import Iterator

WAITING = 2000  # records


class _ToRosout(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self._rosout = logging.getLogger("rosout")

    def emit(self, record: logging.LogRecord) -> None:
        self._rosout.handle(record)


def install() -> None:
    """Hand every record of this package to the logger `rosout`; call once, after `init_node`."""
    package = logging.getLogger("rosbot_patrol")
    if not any(isinstance(h, _ToRosout) for h in package.handlers):
        package.addHandler(_ToRosout())
        package.setLevel(logging.INFO)
        package.propagate = False


class _ToQueue(logging.handlers.QueueHandler):
    """Never waits: what there is no room for is left out, which the next line tells."""

    _left_out = 0

    def enqueue(self, record: logging.LogRecord) -> None:
        if self._left_out:
            record.msg = f"{record.msg} ({self._left_out} lines before this were left out)"
        try:
            self.queue.put_nowait(record)
        except queue.Full:
            self._left_out += 1
        else:
            self._left_out = 0


@contextlib.contextmanager
def in_background() -> Iterator[None]:
    """Meanwhile, write the records on a thread of its own.

    rospy asks the master for a parameter at each line, and waits for the answer: 2 ms, and 100 ms on a busy machine.
    """
    package = logging.getLogger("rosbot_patrol")
    handlers = package.handlers[:]
    records: queue.Queue[logging.LogRecord] = queue.Queue(WAITING)
    listener = logging.handlers.QueueListener(records, *handlers)
    package.handlers[:] = [_ToQueue(records)]
    listener.start()
    try:
        yield
    finally:
        package.handlers[:] = handlers
        with contextlib.suppress(queue.Full):
            listener.stop()
