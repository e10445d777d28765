"""What the patrol writes is for its user only, also what lies there from before; other things stay as they are."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.alerts.dispatch.dispatcher import Dispatcher
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import Incident
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.ros.runtime.private_files import keep_private


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


def open_to_others(folder):
    return [str(path) for path in (folder, *folder.rglob("*")) if not path.is_symlink() and mode(path) & 0o077]


def make(folder, *names, of=0o644):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
        path.chmod(of)


OURS = (
    "outbox/status.json", "outbox/sent/000000000001-a.notice", "incidents/m1/best-1.jpg", "held/b.notice",
    "patrol.json", "calls.jsonl", "ignored.old.jsonl", "incidents.sqlite", "incidents.sqlite-wal",
    "incidents.sqlite.imported", "incidents/chain.jsonl", "incidents/index.sqlite",
    "incidents.sqlite.broken-1", "alive", "incidents.reserve", "sensors.json", "stop.json.broken", "mail/new/a",
    "mail/cur/b", "mail/tmp/c", ".patrol.json.7.tmp",
)  # fmt: skip


def write_all(folder):
    """As patrol and watch do."""
    outbox = Outbox(folder / "outbox")
    post = Dispatcher(outbox, [])
    outbox.put(Notice(id="a", wall=1.0, kind="fault", subject="s", text="t"))
    post.take_over()
    post.write_status()
    with IncidentStore(folder, wall=1.0) as store:
        store.begin(Incident(id="m0", wall=1.0, room_id=3, room_name="hall"))
        store.add_files("m0", [NewFile(name="best-1.jpg", role="best", data=b"\xff\xd8 jpeg")])
    post.hand_over()


def test_what_is_made_is_private(tmp_path):
    keep_private(tmp_path / "deep" / "state")
    write_all(tmp_path / "deep" / "state")
    assert open_to_others(tmp_path / "deep") == []


def test_what_was_open_is_closed_with_one_line(tmp_path, caplog):
    folder = tmp_path / "state"
    make(folder, *OURS)
    (folder / "held" / "b.notice").chmod(0o4666)
    keep_private(folder)
    assert open_to_others(folder) == []
    assert mode(folder / "held" / "b.notice") == 0o4600
    (said,) = [record.getMessage() for record in caplog.records]
    assert said == f"other users could read {len(OURS) + 10} of the files and folders in {folder}; no more"
    keep_private(folder)
    assert len(caplog.records) == 1
    assert all((folder / name).read_text() == "x" for name in OURS)


@pytest.mark.parametrize(
    "theirs", ["notes.txt", "www/index.html", "mail/inbox", "outbox.txt", "Documents/outbox/a.json"]
)
def test_a_folder_with_other_things_stays_open_and_what_is_ours_is_closed(tmp_path, caplog, theirs):
    make(tmp_path, theirs, "outbox/status.json", "patrol.json")
    tmp_path.chmod(0o755)
    keep_private(tmp_path)
    assert (mode(tmp_path), mode(tmp_path / theirs)) == (0o755, 0o644)
    assert (mode(tmp_path / "outbox"), mode(tmp_path / "outbox" / "status.json")) == (0o700, 0o600)
    assert mode(tmp_path / "patrol.json") == 0o600
    assert f"is not the patrol's alone ({theirs.partition('/')[0]})" in caplog.text
    assert "give the patrol a folder of its own" in caplog.text


def test_a_folder_for_everybody_stays_one_even_where_it_is_empty(tmp_path, caplog, monkeypatch):
    shared = tmp_path / "tmp"
    shared.mkdir()
    shared.chmod(0o1777)
    keep_private(shared)
    assert mode(shared) == 0o1777
    home = tmp_path / "home"
    home.mkdir()
    home.chmod(0o755)
    monkeypatch.setenv("HOME", str(home))
    keep_private(home)
    assert mode(home) == 0o755
    assert caplog.text.count("it is a folder for everybody") == 2


def test_links_are_left_alone(tmp_path):
    make(tmp_path, "elsewhere/secret.txt", "state/outbox/a.json")
    for name in ("state/outbox/link", "state/patrol.json"):
        (tmp_path / name).symlink_to(tmp_path / "elsewhere" / "secret.txt")
    (tmp_path / "state" / "incidents").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "state" / "outbox" / "gone").symlink_to(tmp_path / "nowhere")
    (tmp_path / "elsewhere").chmod(0o755)
    keep_private(tmp_path / "state")
    assert (mode(tmp_path / "elsewhere"), mode(tmp_path / "elsewhere" / "secret.txt")) == (0o755, 0o644)
    assert mode(tmp_path / "state" / "outbox" / "a.json") == 0o600


def test_a_state_dir_that_is_a_link_is_followed(tmp_path):
    make(tmp_path / "real", "patrol.json")
    (tmp_path / "state").symlink_to(tmp_path / "real")
    keep_private(tmp_path / "state")
    assert open_to_others(tmp_path / "real") == []


def test_what_cannot_be_changed_is_said_and_the_program_goes_on(tmp_path, caplog, monkeypatch):
    make(tmp_path, "patrol.json", "stop.json", "outbox/a.json")
    real = Path.chmod

    def chmod(path, bits):
        if path.name == "patrol.json":
            raise PermissionError(1, "Operation not permitted")
        if path.name == "a.json":
            raise FileNotFoundError(2, "it went to the owner meanwhile")
        real(path, bits)

    monkeypatch.setattr(Path, "chmod", chmod)
    keep_private(tmp_path)
    assert f"other users can still read 1 of the files in {tmp_path}" in caplog.text
    assert "patrol.json: Operation not permitted" in caplog.text
    assert mode(tmp_path / "stop.json") == 0o600


def test_no_folder_and_one_that_is_a_file(tmp_path, caplog):
    keep_private(tmp_path / "none")
    assert caplog.text == ""
    make(tmp_path, "file")
    keep_private(tmp_path / "file")
    assert "cannot be looked through" in caplog.text


@pytest.mark.parametrize(
    ("program", "words"), [("notify", ["--test"]), ("incidents", ["report", "m0", "--out", "OUT"])]
)
def test_the_tools_write_private_files_too(tmp_path, program, words):
    os.umask(0o077)
    write_all(tmp_path / "rosbot_patrol")
    words = [str(tmp_path / "out") if word == "OUT" else word for word in words]
    code = f"import os; os.umask(0o022); from rosbot_patrol.ros.post.{program} import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        env={**os.environ, "ROS_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert open_to_others(tmp_path / "rosbot_patrol") == []
    made = (
        list((tmp_path / "rosbot_patrol" / "mail").rglob("*P*")) if program == "notify" else list(tmp_path.glob("out*"))
    )
    assert made
    assert not any(mode(path) & 0o077 for path in made)
