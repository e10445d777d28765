"""The memory of a node that works on large arrays in several threads."""

from __future__ import annotations

import ctypes
import logging

log = logging.getLogger(__name__)

_M_MMAP_THRESHOLD = -3  # of mallopt(3)
LARGE = 1 << 20  # [bytes]


def give_back_large_blocks(size: int = LARGE) -> bool:
    """Let freed blocks of a size [bytes] and more go back to the system at once (mallopt(3) of glibc).

    Otherwise glibc raises that bound to 32 MB by itself, and each thread keeps what it has ever used: the copies of a
    costmap of 12 million cells came to 600 MB. Returns whether the C library knows of it.
    """
    try:
        done = bool(ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, size))
    except AttributeError:
        done = False
    if not done:
        log.info("this C library keeps freed memory: nodes with large costmaps take more of it")
    return done
