"""Each guard has a state folder of its own, by its namespace; a second one in the same folder is refused."""

import logging
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.errors import ParamError
from rosbot_patrol.ros.post import incidents as incidents_tool
from rosbot_patrol.ros.post import notify as notify_tool
from rosbot_patrol.ros.runtime import state_folder


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    monkeypatch.delenv("ROS_NAMESPACE", raising=False)
    monkeypatch.setattr(state_folder, "_held", [])
    monkeypatch.setattr(state_folder, "_PATIENCE", 0.0)


@pytest.mark.parametrize(
    ("given", "namespace", "name"),
    [
        ("", "/", "rosbot_patrol"),
        ("", "/robot1/", "rosbot_patrol-robot1"),
        ("", "robot1", "rosbot_patrol-robot1"),
        ("", "/home/robot2/", "rosbot_patrol-home-robot2"),
        (None, "/", "rosbot_patrol"),
    ],
)
def test_each_namespace_has_a_folder(tmp_path: Path, given: str | None, namespace: str, name: str) -> None:
    assert state_folder.state_folder(given, namespace) == tmp_path / name


def test_a_folder_that_is_given_counts_in_any_namespace(tmp_path: Path) -> None:
    assert state_folder.state_folder(str(tmp_path / "mine"), "/robot1/") == tmp_path / "mine"
    assert state_folder.state_folder("~/mine", "/") == Path.home() / "mine"


def test_a_second_patrol_in_the_same_folder_is_refused_and_may_come_when_the_first_has_ended(tmp_path: Path) -> None:
    state_folder.claim_folder(tmp_path / "state", "/patrol/state_dir")
    with pytest.raises(ParamError, match=r"^/patrol/state_dir: is .*state, which another patrol .* uses"):
        state_folder.claim_folder(tmp_path / "state", "/patrol/state_dir")
    state_folder.claim_folder(tmp_path / "other", "/patrol/state_dir")
    for lock in state_folder._held:
        lock.close()
    state_folder.claim_folder(tmp_path / "state", "/patrol/state_dir")


def test_a_folder_that_cannot_be_made_stops_nobody(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "file").write_text("")
    with caplog.at_level(logging.WARNING):
        state_folder.claim_folder(tmp_path / "file" / "state", "/patrol/state_dir")
    assert "cannot be locked against a second patrol" in caplog.text


def test_the_tools_look_where_the_guard_of_their_namespace_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ROS_NAMESPACE", "/robot1")
    assert notify_tool.run(["--list"]) == 0
    assert f"{tmp_path}/rosbot_patrol-robot1/outbox" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        incidents_tool.main(["list"])
    assert ended.value.code == 1
    assert f"{tmp_path}/rosbot_patrol-robot1" in capsys.readouterr().err
