"""Calls on disk before they count as taken."""

import os
import signal
import subprocess
import sys

from rosbot_patrol.patrol.journal import Journal


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


def test_a_kill_right_after_a_call_was_taken_loses_nothing(tmp_path):
    code = (
        "import sys; from pathlib import Path; from rosbot_patrol.patrol.journal import Journal\n"
        "journal = Journal(Path(sys.argv[1]), 0)\n"
        "while True: print(journal.add(5, 1.0), flush=True)\n"
    )
    path = tmp_path / "calls.jsonl"
    process = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE, text=True)
    told = [int(process.stdout.readline()) for _ in range(20)]
    os.kill(process.pid, signal.SIGKILL)
    rest = process.communicate()[0].split("\n")
    told += [int(line) for line in rest[:-1] if line]
    assert {number for number, *_ in Journal(path, 0).left} >= set(told)
