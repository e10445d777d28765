"""pybullet's own line on the console is left out, and nothing else."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from rosbot_patrol.simulation.physics.bullet import _import_quietly

CHATTER = 'import os\nos.write(2, b"{}\\n")\n'


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> str:
    """A module that writes its parameter to the console as a library in C does."""
    name = "chatters_on_import"
    (tmp_path / f"{name}.py").write_text(request.param)
    monkeypatch.syspath_prepend(tmp_path)
    sys.modules.pop(name, None)
    return name


@pytest.mark.parametrize("module", [CHATTER.format("pybullet build time: Jan 29 2025")], indirect=True)
def test_the_line_about_the_build_is_left_out(module: str, capfd: pytest.CaptureFixture) -> None:
    assert _import_quietly(module).__name__ == module
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("module", [CHATTER.format("numpy is too old") + "raise ImportError('no')"], indirect=True)
def test_what_else_is_written_is_passed_on(module: str, capfd: pytest.CaptureFixture) -> None:
    with pytest.raises(ImportError, match="no"):
        _import_quietly(module)
    assert capfd.readouterr().err == "numpy is too old\n"
