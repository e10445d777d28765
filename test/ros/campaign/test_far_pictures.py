"""Pictures to train on, drawn by the workers of a real scheduler: the same as here."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from dask_machines import Machines, connected

pytest.importorskip("distributed", reason="dask.distributed is not installed: sudo apt-get install python3-distributed")

from rosbot_patrol.ros.campaign.cluster import Cluster, ClusterError
from training.pictures import afar
from training.pictures.render import Job, draw

ROOT = Path(__file__).parents[3]


def shards(folder: Path, count: int) -> list[Job]:
    told = {"house_share": 1.0, "plain": True}
    return [
        Job(folder / f"own-{k:04d}.npy", (7, k, 0), ROOT / "worlds" / "flat.world", False, told, 0.0, count=3)
        for k in range(count)
    ]


def start_worker(machines: Machines) -> None:
    arguments = ["-W", "ignore", "-m", "training.pictures.afar", machines.address, "--processes", "1"]
    machines.start(arguments, {"PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}, cwd=ROOT)


def test_shards_from_afar_are_those_drawn_here(machines: Machines, tmp_path: Path) -> None:
    machines.schedule()
    start_worker(machines)
    connected(lambda: Cluster(machines.address, afar.task())).close()
    far, here = tmp_path / "far", tmp_path / "here"
    far.mkdir()
    here.mkdir()
    jobs = shards(far, 2)
    (far / "own-0001.npy").write_bytes(b"drawn before")
    assert sorted(afar.draw_afar(machines.address, jobs)) == ["own-0000.npy", "own-0001.npy"]
    draw(shards(here, 1)[0])
    assert sorted(path.name for path in far.iterdir()) == ["own-0000.npy", "own-0000.npz", "own-0001.npy"]
    assert np.array_equal(np.load(far / "own-0000.npy"), np.load(here / "own-0000.npy"))
    boxes = [np.load(folder / "own-0000.npz")["boxes"] for folder in (far, here)]
    assert np.array_equal(*boxes)
    assert (far / "own-0001.npy").read_bytes() == b"drawn before"


def test_what_no_worker_can_draw_is_a_sentence(machines: Machines, tmp_path: Path) -> None:
    machines.schedule()
    start_worker(machines)
    connected(lambda: Cluster(machines.address, afar.task())).close()
    lost = Job(tmp_path / "lost-0000.npy", (7, 0, 0), tmp_path / "nowhere.world", False, {}, 0.0, count=1)
    with pytest.raises(ClusterError, match=r"lost-0000\.npy: no worker could do it: .*nowhere\.world"):
        list(afar.draw_afar(machines.address, [lost]))
