"""The workspace of one copy beside that of another."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


def test_the_drop_ins_of_another_copy_are_no_originals(tmp_path: Path) -> None:
    """A shell that has another copy's workspace once left the house without move_base."""
    other = tmp_path / "other" / "src" / "move_base"
    other.mkdir(parents=True)
    (other / "package.xml").write_bytes((ROOT / "drop_in" / "move_base" / "package.xml").read_bytes())
    (tmp_path / "ws" / "src").mkdir(parents=True)
    environment = {**os.environ, "ROS_PACKAGE_PATH": str(other.parent)}
    command = [ROOT / "scripts" / "link_workspace", tmp_path / "ws"]
    said = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    assert "move_base" not in said.stdout
    assert (tmp_path / "ws" / "src" / "move_base").is_symlink()
    original = other / "package.xml"
    original.write_text(original.read_text().replace("rosbot_patrol", "nav_core"))
    said = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    assert "move_base" in said.stdout
    assert not (tmp_path / "ws" / "src" / "move_base").exists()
