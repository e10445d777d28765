"""Import of pybullet without the line about its build that it writes to every console.

On a robot the simulator is not installed (`scripts/bootstrap --robot`). The import then succeeds all the same, and the
first use raises a WorldError that says so.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

from rosbot_patrol.errors import WorldError

_CHATTER = b"pybullet build time:"


def _import_quietly(name: str) -> Any:
    """Import a C module and suppress its message; other output to stderr is passed on."""
    try:
        stderr = os.dup(2)
    except OSError:  # no stderr, as in a daemon
        return importlib.import_module(name)
    written = os.memfd_create("stderr")
    os.dup2(written, 2)
    try:
        return importlib.import_module(name)
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        lines = os.pread(written, os.fstat(written).st_size, 0).splitlines(keepends=True)
        os.close(written)
        os.write(2, b"".join(line for line in lines if not line.startswith(_CHATTER)))


class _NotInstalled:
    def __getattr__(self, name: str) -> Any:
        raise WorldError("pybullet", "the simulated house needs it and it is not installed: run scripts/bootstrap")


try:
    pybullet = _import_quietly("pybullet")
except ModuleNotFoundError:
    pybullet = _NotInstalled()
