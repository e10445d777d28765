"""Programs that fail, hang and end, several at once, and the runner goes on."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rosbot_patrol.msg", reason="the workspace is not on the path: `. scripts/env`")
from rosbot_patrol.errors import WorldError
from rosbot_patrol.ros.campaign import runner as campaign_runner
from rosbot_patrol.ros.campaign.runner import Job, Runner


def job(name: str, code: str, folder: Path, limit: float = 20.0) -> Job:
    return Job(name, [sys.executable, "-S", "-c", code], folder / f"{name}.log", limit)


def test_no_job_ends_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign_runner, "GRACE", 0.0)
    ended: dict[str, str] = {}
    runner = Runner(2, ["env"], ["env"], lambda job, problem: ended.update({job.name: problem}))
    runner.run(
        [
            job("well", "print('said')", tmp_path),
            job("hangs", "import time; time.sleep(60)", tmp_path, limit=1.0),
            job("fails", "raise SystemExit(3)", tmp_path),
            Job("nothing", ["/no/such/program"], tmp_path / "nothing.log", 20.0),
        ]
    )
    assert ended["well"] == ""
    assert ended["hangs"] == "did not end within 1 s"
    assert ended["fails"] == f"ended with status 3, see {tmp_path / 'fails.log'}"
    assert ended["nothing"].startswith("ended with status 127")
    assert (tmp_path / "well.log").read_text() == "said\n"


def test_without_spaces_of_their_own_they_run_one_after_another(tmp_path: Path) -> None:
    times: list[float] = []
    runner = Runner(4, [], [], lambda job, problem: times.append(time.monotonic()))
    runner.run([job(str(i), "import time; time.sleep(0.3)", tmp_path) for i in range(3)])
    assert len(times) == 3
    assert times[2] - times[0] > 0.5


def test_a_command_that_is_not_there_to_wrap_is_a_problem_and_no_end(tmp_path: Path) -> None:
    problems: list[str] = []
    Runner(1, [], ["/no/such/lock"], lambda job, problem: problems.append(problem)).run([job("a", "", tmp_path)])
    assert "could not be started" in problems[0]


def test_what_goes_wrong_in_planning_ends_the_run_and_is_not_lost(tmp_path: Path) -> None:
    def jobs() -> Iterator[Job]:
        yield job("a", "", tmp_path)
        raise WorldError("flat", "has no room")

    done: list[str] = []
    with pytest.raises(WorldError, match="has no room"):
        Runner(2, ["env"], [], lambda job, problem: done.append(job.name)).run(jobs())
    assert done in ([], ["a"])
