"""Programs of the system that the set-up calls as root; what they refuse becomes a sentence."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from rosbot_patrol.errors import HostError

_APT = ("apt-get", "-o", "DPkg::Lock::Timeout=300", "install", "-y", "--no-install-recommends")
_PATH = "/usr/sbin:/usr/bin:/sbin:/bin"


def run(*command: str, given: str | None = None) -> str:
    """Run a program; returns what it printed.

    Args:
        command: program and arguments.
        given: its standard input.

    Raises:
        HostError: it is not there, or failed; quotes its first line.
    """
    environment = {**os.environ, "PATH": _PATH, "LC_ALL": "C"}
    try:
        done = subprocess.run(
            command, input=given or "", capture_output=True, text=True, check=False, env=environment, timeout=600.0
        )
    except (OSError, subprocess.TimeoutExpired) as err:
        raise HostError(command[0], f"cannot be run: {err}") from err
    if done.returncode:
        said = (done.stderr.strip() or done.stdout.strip()).splitlines()
        raise HostError(" ".join(command[:3]), said[0] if said else f"ended with status {done.returncode}")
    return done.stdout


def has(program: str) -> bool:
    """Whether a program is installed."""
    return shutil.which(program, path=_PATH) is not None


def install(programs: Sequence[tuple[str, str]]) -> list[str]:
    """Install the Debian packages of missing programs, given as (program, package); returns the packages."""
    missing = [package for program, package in programs if not has(program)]
    if missing:
        try:
            run("apt-get", "-o", "DPkg::Lock::Timeout=300", "update")
            run("env", "DEBIAN_FRONTEND=noninteractive", *_APT, *missing)
        except HostError as err:
            raise HostError(f"package {' '.join(missing)}", f"cannot be installed: {err.problem}") from err
    return missing


def has_systemd() -> bool:
    """Whether systemd manages this machine."""
    return Path("/run/systemd/system").is_dir()


def write(path: Path, text: str, mode: int = 0o644) -> bool:
    """Write a file of the system in one step; returns whether it has changed."""
    try:
        if path.exists() and path.read_text("utf-8") == text and path.stat().st_mode & 0o777 == mode:
            return False
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(f".{path.name}.part")
        part.unlink(missing_ok=True)
        with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "w", encoding="utf-8") as file:
            os.fchmod(file.fileno(), mode)
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as err:
        raise HostError(str(path), f"cannot be written: {err.strerror}") from err
    return True
