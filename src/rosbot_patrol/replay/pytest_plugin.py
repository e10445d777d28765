"""Bags as tests: each NAME.replay.yaml (see `case`) below the given folders is one.

pytest -p rosbot_patrol.replay.pytest_plugin FOLDER
pytest -p rosbot_patrol.replay.pytest_plugin FOLDER --replay-record     # store the results as expected
pytest -p rosbot_patrol.replay.pytest_plugin FOLDER --replay-plots OUT  # plots of those that differ
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rosbot_patrol.errors import PatrolError
from rosbot_patrol.replay.case import SUFFIX, Case, read_case, run_case
from rosbot_patrol.replay.results.comparison import Difference, compare
from rosbot_patrol.replay.results.plots import write_plots
from rosbot_patrol.replay.results.tables import Result, load_result, save_result


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the two options."""
    group = parser.getgroup("replay", "bags replayed as tests")
    group.addoption("--replay-record", action="store_true", help="store what comes of each replay as expected")
    group.addoption("--replay-plots", metavar="FOLDER", help="draw the replays that differ there")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.File | None:
    """Collect each NAME.replay.yaml."""
    if not file_path.name.endswith(SUFFIX):
        return None
    found: pytest.File = CaseFile.from_parent(parent, path=file_path)
    return found


class CaseFile(pytest.File):
    """A yaml with one test."""

    def collect(self) -> Iterator[pytest.Item]:
        """Collect the test, named after the yaml."""
        yield CaseItem.from_parent(self, name=self.path.name.removesuffix(SUFFIX))


class DiffersError(Exception):
    """Error: a replay's result differs from the stored one."""

    def __init__(self, case: Case, differences: list[Difference], pictures: Path | None) -> None:
        lines = [f"{case.setup.node} over {case.bag} differs from {case.expected}:"]
        lines += [f"  {each}" for each in differences]
        lines += [f"  pictures in {pictures}"] if pictures else []
        lines += ["  as it should be? --replay-record stores it"]
        super().__init__("\n".join(lines))


class CaseItem(pytest.Item):
    """One replay, compared with the stored result."""

    def runtest(self) -> None:
        """Replay, then compare or store."""
        case = read_case(self.path)
        if case.is_optional and not case.bag.exists():
            pytest.skip(f"there is no bag {case.bag}")
        result = run_case(case)
        if self.config.getoption("--replay-record", default=False):
            save_result(case.expected, result)
            return
        stored = load_result(case.expected)
        differences = compare(stored, result, case.fields)
        if differences:
            raise DiffersError(case, differences, self._draw(case, result, stored))

    def _draw(self, case: Case, result: Result, stored: Result) -> Path | None:
        folder = self.config.getoption("--replay-plots", default=None)
        if not folder:
            return None
        own = Path(folder) / self.name
        write_plots(own, result, stored, case.fields)
        return own

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """The differences, or why it cannot be used, without a trace."""
        if isinstance(excinfo.value, (DiffersError, PatrolError)):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Location of the test."""
        return self.path, None, f"replay {self.name}"
