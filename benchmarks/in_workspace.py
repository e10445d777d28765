"""Restart of a benchmark in the built workspace, whatever shell and python started it.

Each benchmark imports this module first: `python3 benchmarks/NAME.py` restarts with the workspace's interpreter and
ROS's environment, unless this is that interpreter already.
"""

from __future__ import annotations

import importlib.util
import os
import shlex
import sys
from collections.abc import Sized
from pathlib import Path

HERE = Path(__file__).resolve().parent
WORKSPACE = HERE.parent / ".ws"
ENTERED = "ROSBOT_PATROL_BENCHMARK"
PYTHON = WORKSPACE / "venv" / "bin" / "python"


def require_figures(found: Sized, why: str = "nothing was measured") -> None:
    """End with status 1 and a sentence if a table would be empty."""
    if not found:
        sys.exit(f"{Path(sys.argv[0]).name}: {why}")


def _program() -> Path | None:
    """The benchmark that is running, None if another program imports this."""
    file = getattr(sys.modules["__main__"], "__file__", None)
    path = Path(file).resolve() if file else None
    return path if path is not None and path.parent == HERE else None


def _is_here() -> bool:
    """Whether this is the workspace's interpreter in the workspace's environment."""
    prefixes = os.environ.get("CMAKE_PREFIX_PATH", "").split(os.pathsep)
    is_ours = Path(sys.prefix).resolve() == PYTHON.parents[1].resolve()
    return is_ours and any(Path(p).resolve() == WORKSPACE / "devel" for p in prefixes if p)


def _enter(program: Path) -> None:
    if not PYTHON.exists() or not (WORKSPACE / "devel" / "setup.bash").exists():
        if importlib.util.find_spec("rosbot_patrol") is None:
            sys.exit(f"{program.name}: the workspace is not built: run scripts/bootstrap")
        return  # this shell has another workspace
    env, python = shlex.quote(str(HERE.parent / "scripts" / "env")), shlex.quote(str(PYTHON))
    # in a function, so that catkin's setup does not read the benchmark's arguments
    command = f'enter() {{ . {env}; }}; enter && exec {python} "$0" "$@"'
    again = {**os.environ, ENTERED: "1"}
    os.execve("/bin/bash", ["bash", "-c", command, str(program), *sys.argv[1:]], again)


_main = _program()
if _main is not None and ENTERED not in os.environ and not _is_here():
    _enter(_main)
