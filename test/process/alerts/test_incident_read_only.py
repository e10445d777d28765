"""Incidents on a disk that takes nothing, with and without a sound index."""

import shutil
import subprocess

import pytest

from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.query import Query, find_incidents
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify
from rosbot_patrol.errors import StoreError


def kill(folder):
    """As a kill leaves it: with a WAL."""
    with IncidentStore(folder) as store:
        store.amend("m0", wall=9.0, text="the plumber")
        shutil.copytree(folder / "incidents", folder / "copy")
    shutil.rmtree(folder / "incidents")
    (folder / "copy").rename(folder / "incidents")
    (folder / "incidents" / "index.sqlite-shm").unlink()
    assert (folder / "incidents" / "index.sqlite-wal").stat().st_size


STATES = {
    "sound": lambda folder: None,
    "missing": lambda folder: (folder / "incidents" / "index.sqlite").unlink(),
    "garbage": lambda folder: (folder / "incidents" / "index.sqlite").write_bytes(b"no database" * 999),
    "with a WAL": kill,
}


@pytest.fixture
def disk(tmp_path, make_incident):
    folder = tmp_path / "disk"
    with IncidentStore(folder, wall=1.0) as store:
        for name in ("m0", "m1"):
            store.begin(make_incident(id=name))
            store.add_files(name, [NewFile(name="a.jpg", role="best", data=b"jpeg")])
        store.close("m0", wall=5.0)
    yield folder
    while subprocess.run(["umount", "-l", folder], capture_output=True, check=False).returncode == 0:
        pass


def make_read_only(folder):
    for options in (["--bind", folder, folder], ["-o", "remount,bind,ro", folder]):
        if subprocess.run(["mount", *options], capture_output=True, check=False).returncode:
            pytest.skip("needs the right to mount a disk")


@pytest.mark.parametrize("state", STATES)
def test_they_are_listed_and_verified(disk, state):
    STATES[state](disk)
    make_read_only(disk)
    with IncidentStore(disk, read_only=True) as store:
        found = find_incidents(store.connection, store.path, Query())
        assert sorted(row.id for row in found) == ["m0", "m1"]
        assert store.open_ids() == ("m1",)
        done = verify(store)
        assert done.fits, done.problems
        assert (done.records, done.open, done.files) == (1, 1, 1)
    with pytest.raises(StoreError, match="Read-only file system"):
        IncidentStore(disk)
