"""What scripts/hash_requirements refuses."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


def test_a_file_that_is_not_pinned_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "requirements.txt"
    for line in ("six", "six>=1.0", "six==1.16.0  # why", "-r other.txt"):
        file.write_text(f"# comment\n\n{line}\n", encoding="utf-8")
        done = subprocess.run(
            [sys.executable, ROOT / "scripts" / "hash_requirements", file], capture_output=True, text=True, check=False
        )
        assert done.returncode == 1
        assert f"expected NAME==VERSION or a comment, got '{line}'" in done.stderr
        assert file.read_text(encoding="utf-8") == f"# comment\n\n{line}\n"
