"""The key file of the sensors: `keys: {1: "64 hexadecimal digits", 2: ...}`, readable by its owner alone.

Keys never appear on the parameter server, in a log or in an error message.
"""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Mapping
from pathlib import Path

from rosbot_patrol.errors import ParamError
from rosbot_patrol.rosserial.protocol.proof import KEY_SIZE
from rosbot_patrol.yaml_files import read_mapping

_MIN_DISTINCT = 8  # distinct bytes; 32 random ones hardly ever have fewer than 24


def new_key() -> bytes:
    """Make a random key."""
    return secrets.token_bytes(KEY_SIZE)


def yaml_line(sensor_id: int, key: bytes) -> str:
    """Line for a sensor in the bridge's key file, below `keys:`."""
    return f'  {sensor_id}: "{key.hex()}"'


def c_define(sensor_id: int, key: bytes) -> str:
    """Line for the firmware's header of credentials."""
    return f'#define SENSOR_ID {sensor_id}\n#define SENSOR_KEY "{key.hex()}"'


def read_keys(path: str | Path) -> dict[int, bytes]:
    """Read the keys of a file, by sensor id.

    Raises:
        ParamError: it cannot be used; names the file and the sensor, never a key.
    """
    path = Path(path).expanduser()
    _check_mode(path)
    tree = read_mapping(path, keys="'keys'", is_secret=True)
    unknown = [str(name) for name in tree if name != "keys"]
    if unknown:
        raise ParamError(f"{path}: {unknown[0][:20]!r}", "is not known here, expected 'keys' alone")
    entries = tree.get("keys")
    if not isinstance(entries, dict) or not entries:
        raise ParamError(f"{path}: keys", 'expected one line per sensor, as 2: "64 hexadecimal digits"')
    keys: dict[int, bytes] = {}
    for name, value in entries.items():
        sensor_id = _sensor_id(path, name)
        if sensor_id in keys:
            raise ParamError(f"{path}: keys/{sensor_id}", "stands twice")
        key = _key(f"{path}: keys/{sensor_id}", value)
        twin = next((i for i, other in keys.items() if other == key), None)
        if twin is not None:
            raise ParamError(f"{path}: keys/{sensor_id}", f"is the key of sensor {twin} too; each needs its own")
        keys[sensor_id] = key
    return keys


def key_of(path: str | Path, sensor_id: int) -> bytes:
    """Read the key of one sensor; raises ParamError if the file cannot be used or lacks it."""
    keys = read_keys(path)
    if sensor_id not in keys:
        raise ParamError(
            f"{path}: keys/{sensor_id}", f"is missing; 'rosrun rosbot_patrol sensor_key {sensor_id}' makes one"
        )
    return keys[sensor_id]


def add_key(path: str | Path, sensor_id: int, key: bytes, *, is_replacing: bool = False) -> None:
    """Add a key to a file, which is created if missing; nobody else may read it.

    Raises:
        ParamError: the file cannot be used, or has a key of that sensor already.
    """
    path = Path(path).expanduser()
    keys: Mapping[int, bytes] = read_keys(path) if path.exists() else {}
    if sensor_id in keys and not is_replacing:
        raise ParamError(f"{path}: keys/{sensor_id}", "is there already; --replace makes a new one")
    lines = ["keys:", *(yaml_line(i, k) for i, k in sorted({**keys, sensor_id: key}.items()))]
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.unlink(missing_ok=True)
        with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as file:
            file.write("\n".join(lines) + "\n")
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as err:
        raise ParamError(str(path), f"cannot be written: {err.strerror}") from err


def _check_mode(path: Path) -> None:
    try:
        mode = path.stat().st_mode
    except OSError as err:
        raise ParamError(str(path), f"cannot be read: {err.strerror}") from err
    if not stat.S_ISREG(mode):
        raise ParamError(str(path), "is no file")
    if mode & 0o077:
        raise ParamError(str(path), f"others can read it (mode {stat.S_IMODE(mode):o}); 'chmod 600 {path}'")


def _sensor_id(path: Path, name: object) -> int:
    if isinstance(name, str) and name.isascii() and name.isdigit():
        name = int(name)
    if isinstance(name, bool) or not isinstance(name, int) or not 0 <= name <= 255:
        raise ParamError(f"{path}: keys/{str(name)[:8]!r}", "expected a sensor id, 0 to 255")
    return name


def _key(name: str, value: object) -> bytes:
    if not isinstance(value, str):
        raise ParamError(name, f"expected {2 * KEY_SIZE} hexadecimal digits in quotes")
    try:
        key = bytes.fromhex(value)
    except ValueError as err:
        raise ParamError(name, f"expected {2 * KEY_SIZE} hexadecimal digits, found others") from err
    if len(key) != KEY_SIZE:
        raise ParamError(name, f"expected {2 * KEY_SIZE} hexadecimal digits, got {2 * len(key)}")
    if len(set(key)) < _MIN_DISTINCT:
        raise ParamError(name, "is not random; 'rosrun rosbot_patrol sensor_key' makes one that is")
    return key
