"""A kill right after a call was taken."""

import os
import signal
import subprocess
import sys

from rosbot_patrol.patrol.calls.journal import Journal


def test_a_kill_right_after_a_call_was_taken_loses_nothing(tmp_path):
    code = (
        "import sys; from pathlib import Path; from rosbot_patrol.patrol.calls.journal import Journal\n"
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
