"""rosrun rosbot_patrol incidents, as a person types it; no master."""

import json
import zipfile

import pytest

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import NO_ROOM, Event, Incident
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.ros.post.incidents import _command_first, _parser, main


@pytest.fixture
def house(tmp_path):
    with IncidentStore(tmp_path, wall=1.0) as store:
        for i, verdict in enumerate(("clear", "confirmed", "unreachable")):
            wall = 1_790_000_000.0 + 3600 * i
            store.begin(Incident(id=f"m{i}", wall=wall, room_id=i, room_name="Küche\x1b[31m", reason="why"))
            store.record(f"m{i}", add=[Event(wall=wall, kind="sensor", text=f"motion sensor {i} sees motion")])
            store.add_files(f"m{i}", [NewFile(name="best-1.jpg", role="best", data=b"\xff\xd8 jpeg")])
            store.close(f"m{i}", wall=wall + 60.0, verdict=verdict)
        store.begin(Incident(id="m3", wall=1_790_020_000.0, room_id=3, room_name="hall"))
        yield tmp_path  # the patrol has it open


@pytest.fixture
def call(house, capsys):
    def call(*words):
        with pytest.raises(SystemExit) as ended:
            main(["--state-dir", str(house), *words])
        said = capsys.readouterr()
        return ended.value.code, said.out, said.err

    return call


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["list"], ["m3", "m2", "m1", "m0"]),
        (["list", "--limit", "1"], ["m3", "(more"]),
        (["list", "--room", "1"], ["m1"]),
        (["list", "--verdict", "open"], ["m3"]),
        (["list", "--verdict", "clear"], ["m0"]),
        (["list", "--text", "kuche", "sensor", "2"], ["m2"]),
        (["search", "motion", "--verdict", "confirmed"], ["m1"]),
        (["list", "--since", "2100-01-01"], []),
        (["list", "--since", "2026-09-21T15:00", "--until", "2026-09-30"], ["m3", "m2", "m1"]),
    ],
)
def test_lists_and_searches(call, words, found):
    code, out, _ = call(*words)
    assert code == 0
    lines = out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == found if found else lines == ["no incidents"]
    assert "\x1b" not in out


COMMANDS = [["list"], ["search", "motion"], ["show", "m1"], ["report", "m1"], ["export", "m1", "m1.zip"], ["verify"]]


@pytest.mark.parametrize("command", [*COMMANDS, ["prune"]], ids=lambda words: words[0])
def test_options_stand_before_or_after_the_command(house, capsys, command, tmp_path_factory, monkeypatch):
    monkeypatch.chdir(tmp_path_factory.mktemp("here"))
    option, said = ["--state-dir", str(house)], []
    for words in ([*option, *command], [*command, *option], [command[0], *option, *command[1:]]):
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert ended.value.code == 0
        said.append(capsys.readouterr().out)
    assert said[0] == said[1] == said[2]


@pytest.mark.parametrize(
    "words",
    [["--room", "1", "list"], ["--json", "list", "--room", "1"], ["--state-dir=search", "list", "--limit", "1"]],
)
def test_options_of_a_command_may_come_first(words):
    assert _parser().parse_args(_command_first(words)).command == "list"


def test_the_help_of_each_command_names_the_folder(capsys):
    for command in (*(words[0] for words in COMMANDS), "prune"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        assert "--state-dir FOLDER" in capsys.readouterr().out


def test_one_of_a_kind_is_singular(tmp_path, capsys):
    with IncidentStore(tmp_path, wall=1.0) as store:
        store.begin(Incident(id="m", wall=1_790_000_000.0, room_id=1, room_name="hall", share_seen=1.0))
        store.close("m", wall=1_790_000_060.0, verdict="clear")
    for words in (["verify"], ["show", "m"]):
        with pytest.raises(SystemExit):
            main([*words, "--state-dir", str(tmp_path)])
    out = capsys.readouterr().out
    assert "all fits: 1 record, 0 files, 0 removed" in out
    assert "100 % of the room's floor was seen" in out


def test_what_makes_no_sense_is_said(call, tmp_path):
    for words, said in (
        (["list", "--since", "soon"], "'soon' is no time"),
        (["list", "--verdict", "maybe"], "invalid choice"),
        (["list", "--limit", "0"], "no number of incidents"),
        (["report"], "expected the id of an incident, or --all"),
    ):
        code, _, err = call(*words)
        assert code == 2
        assert said in err
    assert "there is no incident 'm9'" in call("show", "m9")[2]
    code, _, err = call("--state-dir", str(tmp_path / "nowhere"), "list")
    assert (code, "there is none; the patrol makes it" in err) == (1, True)
    assert not (tmp_path / "nowhere").exists()


def test_one_is_shown(call, house):
    _, out, _ = call("show", "m1")
    assert "motion sensor 1 sees motion" in out
    assert str(house / "incidents" / "m1" / "best-1.jpg") in out
    assert json.loads(call("show", "m1", "--json")[1])["verdict"] == "confirmed"
    assert "still open" in call("show", "m3")[1]


def test_reports_and_exports(call, tmp_path):
    assert call("report", "--all", "--out", str(tmp_path / "out"))[0] == 0
    pages = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert pages == ["m0.html", "m1.html", "m2.html", "m3.html"]
    assert call("export", "m1", str(tmp_path / "m1.zip"))[0] == 0
    with zipfile.ZipFile(tmp_path / "m1.zip") as archive:
        names = {"record.json", "record.canonical.json", "link.json", "report.html", "best-1.jpg"}
        assert set(archive.namelist()) == names
        assert archive.read("best-1.jpg") == b"\xff\xd8 jpeg"
        assert json.loads(archive.read("record.json"))["id"] == "m1"
    assert "Is a directory" in call("export", "m1", str(tmp_path))[2]


def test_verify_says_what_does_not_fit_and_prune_keeps_the_chain(call, house):
    code, out, _ = call("verify")
    assert (code, out.startswith("all fits: 3 records, 3 files, 0 removed by retention, 1 open")) == (0, True)
    head = out.split()[-1]
    assert call("verify", "--expect", head)[0] == 0
    assert call("prune", "--keep-mb", "0")[1].startswith("3 old incidents")
    code, out, _ = call("verify")
    assert (code, out.startswith("all fits: 0 records, 0 files, 3 removed by retention, 1 open")) == (0, True)
    assert call("verify", "--expect", head)[0] == 0
    assert call("verify", "--expect", "0" * 64)[0] == 1


def test_a_changed_picture_is_named(call, house):
    (house / "incidents" / "m1" / "best-1.jpg").write_bytes(b"another")
    code, out, _ = call("verify")
    assert code == 1
    assert out.startswith("the record of m1 (link 3) does not fit: the file best-1.jpg")


def test_a_list_tells_where_the_person_was_and_who_called(house, call):
    seen = {"object_class": "person", "person": (1.0, 2.0), "room_id": 7, "room_name": "study"}
    with IncidentStore(house, wall=1.0) as store:
        for name, room in (("n1", (5, "kitchen")), ("n2", (7, "study")), ("n3", (NO_ROOM, ""))):
            where = dict(zip(("person_room_id", "person_room"), room, strict=True))
            store.begin(Incident(id=name, wall=1_790_030_000.0, **seen, **where))
            store.close(name, wall=1_790_030_060.0, verdict="confirmed")
    lines = {line.split()[0]: line for line in call("list", "--verdict", "confirmed")[1].splitlines()}
    assert "  5 kitchen, called by 7 study  " in lines["n1"]
    assert "  7 study  " in lines["n2"]
    assert "called by" not in lines["n2"]
    assert "  none, called by 7 study  " in lines["n3"]
    assert [line.split()[0] for line in call("list", "--room", "5")[1].splitlines()[1:]] == ["n1"]
    (row,) = [json.loads(line) for line in call("list", "--json", "--room", "5")[1].splitlines()]
    assert (row["room_id"], row["person_room_id"], row["person_room"]) == (7, 5, "kitchen")
    assert call("show", "n1")[1].startswith("person seen in room 5 (kitchen) while")
    assert "x 1.00 m, y 2.00 m, in room 5 (kitchen)" in call("show", "n1")[1]
