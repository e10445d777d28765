"""The memory of a node that works on large arrays, or pictures, in several threads."""

from __future__ import annotations

import ctypes
import logging

log = logging.getLogger(__name__)

_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8  # of mallopt(3)
LARGE = 1 << 20  # [bytes]


def share_one_heap() -> bool:
    """Let all threads take their memory from one place; before there are any.

    Otherwise glibc gives threads places of their own, each of which keeps what it has ever used: republish came to 178
    instead of 172 MB within a quarter of an hour. Python's lock keeps the threads from waiting for one another there.
    Returns whether the C library knows of it.
    """
    return _set_option(_M_ARENA_MAX, 1)


def give_back_large_blocks(size: int = LARGE) -> bool:
    """Let freed blocks of a size [bytes] and more go back to the system at once (mallopt(3) of glibc).

    Otherwise glibc raises that bound to 32 MB by itself, and each thread keeps what it has ever used: the copies of a
    costmap of 12 million cells came to 600 MB. Returns whether the C library knows of it.
    """
    done = _set_option(_M_MMAP_THRESHOLD, size)
    if not done:
        log.info("this C library keeps freed memory: nodes with large costmaps take more of it")
    return done


def _set_option(option: int, value: int) -> bool:
    try:
        return bool(ctypes.CDLL(None).mallopt(option, value))
    except AttributeError:
        return False
