"""The console's secret, and the tokens in notices."""

import stat
from pathlib import Path

from rosbot_patrol.console.access.secret import console_secret, is_seen_token, seen_token


def test_the_secret_is_kept(tmp_path: Path) -> None:
    made = console_secret(tmp_path)
    assert len(made) == 32
    assert console_secret(tmp_path) == made
    assert stat.S_IMODE((tmp_path / "console" / "secret").stat().st_mode) == 0o600


def test_a_part_of_a_secret_is_made_anew(tmp_path: Path) -> None:
    path = tmp_path / "console" / "secret"
    path.parent.mkdir()
    path.write_bytes(b"short")
    assert len(console_secret(tmp_path)) == 32


def test_a_token_is_of_one_incident_and_one_secret() -> None:
    token = seen_token(b"s" * 32, "20261129T060000Z-1")
    assert is_seen_token(b"s" * 32, "20261129T060000Z-1", token)
    assert not is_seen_token(b"s" * 32, "20261129T060000Z-2", token)
    assert not is_seen_token(b"t" * 32, "20261129T060000Z-1", token)
    assert not is_seen_token(b"s" * 32, "20261129T060000Z-1", "äöü")
