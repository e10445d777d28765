"""Files of state: read, written, appended to, and what a full disk leaves."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from rosbot_patrol.errors import StateError
from rosbot_patrol.files import append_line, read_json, write_json


def test_an_object_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "state.json"
    assert read_json(path) is None
    write_json(path, {"mode": "night", "until": None})
    assert read_json(path) == {"mode": "night", "until": None}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "Expecting value"),
        (b'{"mode": ', "Expecting value"),
        (b"[1, 2]", "holds no group of values"),
        (b"7", "holds no group of values"),
        (b"\xff\xfe{", "decode"),
        (b"[" * 100_000, "recursion"),
    ],
)
def test_what_is_no_object_names_the_file_and_the_reason(tmp_path: Path, data: bytes, said: str) -> None:
    path = tmp_path / "state.json"
    path.write_bytes(data)
    with pytest.raises(StateError, match=said) as caught:
        read_json(path)
    assert caught.value.path == str(path)


def test_a_folder_in_its_place_is_told(tmp_path: Path) -> None:
    with pytest.raises(StateError, match="directory"):
        read_json(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(StateError) as caught:
        read_json(tmp_path / "file" / "state.json")
    assert isinstance(caught.value.__cause__, NotADirectoryError)


def test_lines_are_appended_for_this_user_only(tmp_path: Path) -> None:
    path = tmp_path / "calls.jsonl"
    append_line(path, b"one\n")
    append_line(path, b"two\n")
    assert path.read_bytes() == b"one\ntwo\n"
    assert path.stat().st_mode & 0o077 == 0


def test_a_disk_that_takes_half_a_line_keeps_none_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "calls.jsonl"
    append_line(path, b"one\n")
    write = os.write
    monkeypatch.setattr(os, "write", lambda handle, line: write(handle, line[: len(line) // 2]))
    with pytest.raises(OSError, match="No space left"):
        append_line(path, b"two\n")
    assert path.read_bytes() == b"one\n"
