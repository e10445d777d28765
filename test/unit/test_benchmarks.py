"""Benchmarks find their interpreter by themselves, and none prints an empty table as if all were well."""

from __future__ import annotations

import ast
import importlib
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"
PROGRAMS = [path for path in sorted(FOLDER.glob("*.py")) if '__name__ == "__main__"' in path.read_text()]


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Imports a benchmark as others in its folder do."""
    monkeypatch.syspath_prepend(str(FOLDER))

    def imported(name: str) -> ModuleType:
        monkeypatch.delitem(sys.modules, name, raising=False)
        return importlib.import_module(name)

    return imported


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_each_finds_its_interpreter_before_it_imports_anything(program: Path) -> None:
    imports = [node for node in ast.parse(program.read_text()).body if isinstance(node, ast.Import | ast.ImportFrom)]
    first = next(node for node in imports if not (isinstance(node, ast.ImportFrom) and node.module == "__future__"))
    assert isinstance(first, ast.Import)
    assert first.names[0].name == "in_workspace"


def test_a_workspace_that_is_not_built_is_said(load: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    here = load("in_workspace")
    monkeypatch.setattr(here, "PYTHON", tmp_path / "python")
    monkeypatch.setattr(here.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(SystemExit, match=r"alerts\.py: the workspace is not built: run scripts/bootstrap"):
        here._enter(FOLDER / "alerts.py")


def test_an_empty_table_is_a_fault(load: Any) -> None:
    here = load("in_workspace")
    here.require_figures({"contacts": 0.0})
    for nothing in ({}, [], range(0)):
        with pytest.raises(SystemExit, match="nothing was measured"):
            here.require_figures(nothing)


@pytest.mark.parametrize(("good", "status"), [((), "all failed"), (("tiny",), "no figures of: house"), (None, None)])
def test_detection_fails_where_a_part_fails(
    load: Any,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
    good: tuple[str, ...] | None,
    status: str | None,
) -> None:
    detection = load("detection")

    def run(command: list[str], **_: object) -> SimpleNamespace:
        name = command[command.index("--part") + 1]
        if good is not None and name not in good:
            return SimpleNamespace(returncode=1, stdout="", stderr="")
        return SimpleNamespace(returncode=0, stdout='{"recall": 1.0}\n', stderr="")

    monkeypatch.setattr(detection.subprocess, "run", run)
    monkeypatch.setattr(sys, "argv", ["detection.py"])
    if status is None:
        detection.main()
    else:
        with pytest.raises(SystemExit, match=status):
            detection.main()
    assert ("| recall | 1.00 |" in capsys.readouterr().out) == (good != ())
