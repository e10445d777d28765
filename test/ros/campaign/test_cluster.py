"""Patrols on the workers of a real scheduler: with one killed, with other sources, with the scheduler gone."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
from pathlib import Path

import pytest
from dask_machines import Machines, connected

pytest.importorskip("rosbot_patrol.msg", reason="the workspace is not on the path: `. scripts/env`")
pytest.importorskip("distributed", reason="dask.distributed is not installed: sudo apt-get install python3-distributed")

from rosbot_patrol.ros.campaign.cluster import Cluster, ClusterError, pack, unpack
from rosbot_patrol.ros.campaign.far_patrols import PROGRAM, patrols_of, sources_digest

ROOT = Path(__file__).parents[3]
WORDS = ["--timeout", "30"]
# In place of a patrol, which would take a minute: it notes who has played it.
PLAY = """
import json, os, pathlib, sys, time
folder = pathlib.Path(sys.argv[sys.argv.index("--one") + 1])
plan = json.loads((folder / "patrol.json").read_text())
time.sleep(plan["lasts"])
(folder / "result.json").write_text(json.dumps({"number": plan["number"], "worker": os.environ["WORKER"]}))
"""
WORK = "import sys; from rosbot_patrol.ros.campaign.far_patrols import work; work(sys.argv[1], 1)"


def start_worker(machines: Machines, name: str) -> subprocess.Popen[bytes]:
    play = machines.folder / "play.py"
    play.write_text(PLAY)
    return machines.start(["-W", "ignore", "-c", WORK, machines.address], {PROGRAM: str(play), "WORKER": name})


def patrols(folder: Path, count: int, lasts: float) -> list[tuple[str, bytes]]:
    found = []
    for number in range(count):
        patrol = folder / "campaign" / f"{number:04d}"
        patrol.mkdir(parents=True)
        (patrol / "patrol.json").write_text(json.dumps({"number": number, "lasts": lasts}))
        found.append((patrol.name, pack(patrol.parent, [patrol])))
    return found


def test_a_killed_worker_s_patrol_is_played_by_another(machines: Machines, tmp_path: Path) -> None:
    machines.schedule()
    first = start_worker(machines, "first")
    start_worker(machines, "second")
    cluster = connected(lambda: Cluster(machines.address, patrols_of(ROOT, WORDS)))
    results: dict[str, str] = {}

    for name, problem, data in cluster.results(patrols(tmp_path, 6, 0.5)):
        assert problem == ""
        unpack(data, tmp_path / "back")
        results[name] = json.loads((tmp_path / "back" / name / "result.json").read_text())["worker"]
        if "first" in results.values() and first.poll() is None:
            os.killpg(first.pid, signal.SIGKILL)
    cluster.close()
    assert sorted(results) == [f"{n:04d}" for n in range(6)]
    assert set(results.values()) == {"first", "second"}


def test_a_worker_with_other_sources_is_sent_away_and_a_scheduler_that_goes_is_told(
    machines: Machines, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    machines.schedule()
    worker = start_worker(machines, "other")
    cluster = connected(
        lambda: Cluster(machines.address, patrols_of(tmp_path, WORDS))
    )  # a folder without our launch files is another commit
    problems: list[BaseException] = []

    def run() -> None:
        try:
            list(cluster.results(patrols(tmp_path, 1, 0.1)))
        except ClusterError as err:
            problems.append(err)

    thread = threading.Thread(target=run)
    thread.start()
    worker.wait(60.0)
    os.killpg(machines.processes[0].pid, signal.SIGKILL)
    thread.join(60.0)
    cluster.close()
    assert not thread.is_alive()
    assert [str(problem) for problem in problems] == [f"the scheduler {machines.address} is gone"]
    assert "other sources than here, sent away; give it the same commit" in capfd.readouterr().out


def test_nobody_there_is_a_sentence(machines: Machines) -> None:
    with pytest.raises(ClusterError, match=r"the scheduler tcp://127\.0\.0\.1:\d+ does not answer"):
        Cluster(machines.address, patrols_of(ROOT, WORDS), patience=1.0)


def test_the_digest_covers_sources_and_launch_files(tmp_path: Path) -> None:
    assert sources_digest(ROOT) == sources_digest(ROOT)
    (tmp_path / "launch").mkdir()
    (tmp_path / "launch" / "a.launch").write_text("<launch/>")
    before = sources_digest(tmp_path)
    (tmp_path / "launch" / "a.launch").write_text("<launch></launch>")
    assert sources_digest(tmp_path) != before
