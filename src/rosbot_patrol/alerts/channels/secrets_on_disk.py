"""Passwords and secrets: from a private file or the environment, and from nowhere else."""

from __future__ import annotations

import contextlib
import logging
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rosbot_patrol.errors import ParamError

log = logging.getLogger(__name__)

_SECRET = re.compile(r"(?:^|_)(?:password|passwd|passphrase|secret|token|api_?key)$", re.IGNORECASE)


def refuse_secrets(tree: Mapping[str, Any], *, name: str, place: str) -> None:
    """Refuse a password in a place that others can read.

    Args:
        tree: parameters, nested or not.
        name: prefix of their names, for the message.
        place: what is wrong with the place.

    Raises:
        ParamError: names the parameter, never its value.
    """
    for key, value in tree.items():
        if _SECRET.search(str(key)):
            raise ParamError(
                f"{name}{key}",
                f"a password may not stand {place}; put it into a file of mode 600 and name that as {key}_file,"
                " or into the environment",
            )
        if isinstance(value, Mapping):
            refuse_secrets(value, name=f"{name}{key}/", place=place)


def read_secret(name: str, file: str, variable: str, environ: Mapping[str, str]) -> str:
    """A secret from its file, or else from the environment.

    Args:
        name: of the parameter that names the file, for the message.
        file: "" for none.
        variable: of the environment; "" for none.
        environ: the environment.

    Raises:
        ParamError: there is none, or others can read the file.
    """
    if not file:
        if not variable or not environ.get(variable):
            where = f" or the variable {variable}" if variable else ""
            raise ParamError(name, f"needs a password, from this file{where}")
        return _one_line(environ[variable], name, f"the variable {variable}")
    path = Path(file).expanduser()
    try:
        if path.stat().st_mode & 0o077:
            raise ParamError(name, f"{path} can be read by others, expected mode 600")
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as err:
        raise ParamError(name, f"{path} is no text in UTF-8 (byte {err.start})") from None
    except OSError as err:
        raise ParamError(name, f"{path} cannot be read: {err.strerror}") from err
    if not lines or not lines[0]:
        raise ParamError(name, f"{path} is empty")
    return _one_line(lines[0], name, str(path))


def warn_where_open(path: Path, what: str) -> None:
    """Say that others can read a file with something secret in it; one that is gone is said elsewhere."""
    with contextlib.suppress(OSError):
        if path.stat().st_mode & 0o077:
            log.warning("%s can be read by other users, and holds %s: chmod 600 %s", path, what, path)


def _one_line(value: str, name: str, source: str) -> str:
    if not value.isprintable():
        raise ParamError(name, f"{source} holds a line break or control character")
    return value
