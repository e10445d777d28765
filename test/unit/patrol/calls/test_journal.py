"""Calls on disk before they count as taken."""

import logging
import os
import shutil

import pytest

from rosbot_patrol.patrol.calls.journal import Journal


def test_what_was_written_is_there_after_a_restart(tmp_path):
    journal = Journal(tmp_path / "sub" / "calls.jsonl", 0)
    assert [journal.add(room, 5.0) for room in (3, 1)] == [1, 2]
    assert Journal(tmp_path / "sub" / "calls.jsonl", 1).left == [(2, 1, 5.0)]


def test_lines_that_the_memory_knows_are_dropped(tmp_path):
    path = tmp_path / "calls.jsonl"
    journal = Journal(path, 0)
    journal.add(3, 5.0)
    journal.drop(0)
    assert path.stat().st_size
    journal.drop(1)
    assert path.stat().st_size == 0
    assert journal.add(4, 6.0) == 2
    assert Journal(path, 1).left == [(2, 4, 6.0)]


def test_a_line_cut_short_takes_no_other_with_it(tmp_path, caplog):
    path = tmp_path / "calls.jsonl"
    path.write_bytes(b"[1, 3, 5.0]\n[2, 1,")
    journal = Journal(path, 0)
    assert journal.left == [(1, 3, 5.0)]
    assert "makes no sense" in caplog.text
    number = journal.add(7, 9.0)
    assert Journal(path, 1).left == [(number, 7, 9.0)]


def five_calls(path):
    """A journal of five lines, of which the patrol's memory knows the first two."""
    journal = Journal(path, 0)
    for room in (3, 1, 4, 1, 5):
        journal.add(room, 10.0 + room)
    return path.read_bytes()


CALLS = [(3, 4, 14.0), (4, 1, 11.0), (5, 5, 15.0)]


def test_every_flipped_bit_is_noticed_or_changes_nothing(tmp_path, quick):
    path = tmp_path / "calls.jsonl"
    whole = five_calls(path)
    mark = (tmp_path / "calls.mark").read_bytes()
    silent = []
    for i in range(len(whole)):
        for bit in range(8):
            path.write_bytes(bytes([*whole[:i], whole[i] ^ 1 << bit, *whole[i + 1 :]]))
            (tmp_path / "calls.mark").write_bytes(mark)
            journal = Journal(path, 2)
            if not journal.damage and journal.left != CALLS:
                silent.append((i, bit, journal.left))
    assert silent == []


def test_a_cut_at_every_byte_is_noticed(tmp_path, quick):
    path = tmp_path / "calls.jsonl"
    whole = five_calls(path)
    mark = (tmp_path / "calls.mark").read_bytes()
    for size in range(len(whole)):
        path.write_bytes(whole[:size])
        (tmp_path / "calls.mark").write_bytes(mark)
        journal = Journal(path, 2)
        assert "damaged" in journal.damage, size
        assert journal.add(9, 1.0) == 6


@pytest.fixture
def quick(monkeypatch):
    """Many files, and no power cut among them: the disk need not follow."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)
    monkeypatch.setattr(os, "fdatasync", lambda handle: None)
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@pytest.mark.parametrize("harm", ["emptied", "removed", "zeroed"])
def test_calls_that_are_gone_are_told_once(tmp_path, harm):
    path = tmp_path / "calls.jsonl"
    whole = five_calls(path)
    path.unlink()
    if harm != "removed":
        path.write_bytes(b"" if harm == "emptied" else bytes(len(whole)))
    journal = Journal(path, 2)
    assert "3 calls of motion sensors that nobody looked after yet are lost" in journal.damage
    assert journal.left == []
    assert journal.add(7, 9.0) == 6
    again = Journal(path, 5)
    assert (again.left, again.damage) == ([(6, 7, 9.0)], "")


def test_damage_to_calls_that_were_taken_is_none_of_the_owners(tmp_path, caplog):
    path = tmp_path / "calls.jsonl"
    five_calls(path)
    path.write_bytes(b"")
    assert Journal(path, 5).damage == ""
    assert "were taken already" in caplog.text


def test_a_kill_at_any_point_of_adding_and_dropping_is_no_damage(tmp_path, monkeypatch):
    path = tmp_path / "calls.jsonl"
    journal = Journal(path, 0)
    journal.add(3, 5.0)
    with monkeypatch.context() as patched:
        patched.setattr(journal, "_try_mark", lambda: None)  # killed between line and mark
        journal.add(4, 6.0)
    again = Journal(path, 0)
    assert ([room for _, room, _ in again.left], again.damage) == ([3, 4], "")
    with monkeypatch.context() as patched:
        patched.setattr(os, "truncate", lambda *_: None)  # killed between mark and file
        again.drop(2)
    assert Journal(path, 2).damage == ""


def test_a_file_of_an_earlier_version_has_no_mark(tmp_path):
    path = tmp_path / "calls.jsonl"
    path.write_bytes(b"[1, 3, 5.0]\n[2, 1, 6.0]\n")
    journal = Journal(path, 1)
    assert (journal.left, journal.damage) == ([(2, 1, 6.0)], "")


@pytest.mark.parametrize("mark", [b"", b"{", b"[]", b'{"last": 1}', b'{"last": "x", "size": 0, "crc": 0}'])
def test_a_damaged_mark_takes_no_call_with_it(tmp_path, mark, caplog):
    path = tmp_path / "calls.jsonl"
    five_calls(path)
    (tmp_path / "calls.mark").write_bytes(mark)
    assert Journal(path, 2).left == CALLS
    assert "nobody can tell whether all calls are there" in caplog.text


def test_a_disk_that_takes_nothing_fails_each_call_until_it_is_back(tmp_path):
    (tmp_path / "state").write_text("a file")
    journal = Journal(tmp_path / "state" / "calls.jsonl", 7)
    assert journal.damage == ""
    with pytest.raises(OSError, match="state"):
        journal.add(3, 5.0)
    journal.drop(7)
    (tmp_path / "state").unlink()
    assert journal.add(3, 5.0) == 8
    assert Journal(tmp_path / "state" / "calls.jsonl", 7).left == [(8, 3, 5.0)]


def test_a_folder_that_is_removed_meanwhile_is_made_again(tmp_path):
    path = tmp_path / "state" / "calls.jsonl"
    journal = Journal(path, 0)
    journal.add(3, 5.0)
    shutil.rmtree(path.parent)
    journal.add(4, 6.0)
    again = Journal(path, 0)
    assert [room for _, room, _ in again.left] == [4]
    assert "1 call of motion sensors" in again.damage


def test_a_file_that_cannot_be_read_is_told(tmp_path):
    (tmp_path / "calls.jsonl").mkdir()
    assert "cannot be read" in Journal(tmp_path / "calls.jsonl", 0).damage
