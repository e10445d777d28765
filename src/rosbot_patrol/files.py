"""Files: atomic writes, JSON objects, lines that are synced to the disk before they count, and the cache's folder."""

from __future__ import annotations

import errno
import functools
import hashlib
import json
import os
import platform
import sysconfig
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rosbot_patrol.errors import StateError

PACKAGE = Path(__file__).resolve().parent
_EXTENSION: str = sysconfig.get_config_var("EXT_SUFFIX")
DISK_FULL = frozenset((errno.ENOSPC, errno.EDQUOT))  # errno of an OSError: no room on the disk, or in the user's quota


def write_atomic(path: Path, data: bytes) -> None:
    """Write a file so that a crash or power cut leaves the old one or the new one, never a part.

    The folder is made where it is missing.

    Raises:
        OSError: the disk does not take it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, data)
    sync_folder(path.parent)


def write_whole(path: Path, data: bytes) -> None:
    """Like `write_atomic`, in an existing folder that the caller syncs once for many files. Raises OSError."""
    scratch = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with scratch.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        scratch.replace(path)
    except OSError:
        scratch.unlink(missing_ok=True)
        raise


def sync_folder(folder: Path) -> None:
    """Sync the names in a folder to the disk."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_json(path: Path, tree: Mapping[str, Any]) -> None:
    """Write a JSON object with `write_atomic`. Raises OSError."""
    write_atomic(path, json.dumps(tree, indent=1).encode())


def read_json(path: Path) -> dict[str, Any] | None:
    """Read the object in a JSON file; None if there is no such file.

    Raises:
        StateError: the file cannot be read, or holds no JSON object.
    """
    try:
        tree = json.loads(path.read_bytes())
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError) as err:
        raise StateError(path, f"cannot be read ({err})") from err
    if not isinstance(tree, dict):
        raise StateError(path, "holds no group of values")
    return tree


def append_line(path: Path, line: bytes) -> None:
    """Append bytes to a file, all or none, and sync them to the disk. The folder has to exist.

    Raises:
        OSError: the disk does not take them; the file is as it was.
    """
    is_new = not path.exists()
    handle = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    try:
        size = os.fstat(handle).st_size
        try:
            if os.write(handle, line) != len(line):
                raise OSError(errno.ENOSPC, "No space left on device", str(path))
            os.fdatasync(handle)
        except OSError:
            os.ftruncate(handle, size)
            raise
    finally:
        os.close(handle)
    if is_new:
        sync_folder(path.parent)


def cache_folder() -> Path:
    """Folder of files that the set-up makes on this machine: compiled kernels, converted networks.

    It is `ROSBOT_PATROL_CACHE`, by default `$XDG_CACHE_HOME/rosbot_patrol` or `~/.cache/rosbot_patrol`.
    """
    given = os.environ.get("ROSBOT_PATROL_CACHE", "")
    if given:
        return Path(given)
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(base) / "rosbot_patrol"


def kernel_sources() -> list[Path]:
    """Files with kernels, sorted: every `*_kernels.py` below this package."""
    return sorted(PACKAGE.rglob("*_kernels.py"))


@functools.lru_cache(maxsize=1)
def cache_dir() -> Path:
    """Folder of the compiled kernels, named by a hash of all that they depend on.

    These are their sources, what compiles them, the versions of numba and Python, and the processor: a home folder may
    move to another machine. numba's own cache does not notice changes of a callee in another module.
    """
    digest = hashlib.sha256(f"{version('numba')} {_EXTENSION} {_processor()}".encode())
    for path in (*kernel_sources(), PACKAGE / "kernels" / "compiler.py"):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return cache_folder() / f"numba-{digest.hexdigest()[:16]}"


def kernel_library() -> Path:
    """The library of all kernels, which `python -m rosbot_patrol.kernels` makes."""
    return cache_dir() / f"kernels{_EXTENSION}"


def _processor() -> str:
    """What tells one kind of processor from another, as Linux has it."""
    names = ("model name", "flags", "CPU part", "Features")
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").split("\n\n", maxsplit=1)[0].splitlines()
    except OSError:
        lines = []
    return " ".join((platform.machine(), *(line for line in lines if line.startswith(names))))
