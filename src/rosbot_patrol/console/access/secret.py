"""The console's secret: it signs sessions, and the addresses in notices that mark an incident as seen."""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
from pathlib import Path

from rosbot_patrol.files import write_atomic

_LENGTH = 32  # of a token [hex digits]: 128 bits


def console_secret(state_dir: Path) -> bytes:
    """The secret, made at the first call. Raises OSError."""
    path = state_dir / "console" / "secret"
    if path.exists() and len(found := path.read_bytes()) >= 32:
        return found
    scratch = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    write_atomic(scratch, secrets.token_bytes(32))
    scratch.chmod(0o600)
    try:
        if path.exists():  # a part of one, of a crash
            scratch.replace(path)
        else:
            os.link(scratch, path)
    except FileExistsError:  # another program was faster
        pass
    finally:
        scratch.unlink(missing_ok=True)
    return path.read_bytes()


def seen_token(secret: bytes, incident_id: str) -> str:
    """What an address must hold that marks an incident as seen without a session, and does nothing else."""
    return hmac.new(secret, f"seen {incident_id}".encode(), hashlib.sha256).hexdigest()[:_LENGTH]


def is_seen_token(secret: bytes, incident_id: str, token: str) -> bool:
    """Whether a token belongs to an incident."""
    return hmac.compare_digest(seen_token(secret, incident_id).encode(), token.encode())
