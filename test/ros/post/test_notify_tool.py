"""rosrun rosbot_patrol notify: what it says and how it ends. Needs no master."""

import json
import mailbox
import socket

import pytest
from smtp_server import SmtpServer

from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.dispatch.file_lock import FileLock
from rosbot_patrol.alerts.dispatch.settings_file import Settings, write_settings
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.errors import ParamError
from rosbot_patrol.ros.post import notify as notify_tool


@pytest.fixture
def notify(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))

    def notify(*arguments, channels=None):
        if channels is not None:
            (tmp_path / "channels.yaml").write_text(json.dumps({"channels": channels}))
            arguments += ("--config", str(tmp_path / "channels.yaml"))
        status = notify_tool.run(list(arguments))
        return status, capsys.readouterr().out

    return notify


@pytest.fixture
def outbox(tmp_path):
    outbox = Outbox(tmp_path / "rosbot_patrol" / "outbox")
    outbox.make()
    return outbox


def put(outbox, *names):
    for name in names:
        outbox.put(Notice(id=name, wall=1_790_000_000.0, kind="incident", subject="rosbot patrol node", text="t"))


def test_a_test_notice_goes_through_each_channel_and_failures_are_explained(notify, tmp_path):
    with SmtpServer() as server:
        channels = {
            "disk": {"type": "maildir", "folder": str(tmp_path / "mail")},
            "server": {"type": "smtp", "to": "a@b.org", "port": server.port},
            "lost": {"type": "smtp", "to": "a@b.org", "host": "no.such.host.invalid"},
            "bare": {"type": "smtp", "to": "a@b.org", "port": server.port, "security": "starttls"},
        }
        status, said = notify("--test", channels=channels)
        assert status == 1
        assert len(server.mails) == 1
    (mail,) = mailbox.Maildir(tmp_path / "mail", create=False)
    assert mail["Subject"] == "rosbot patrol: a test"
    assert "disk: taken after" in said
    assert "server: taken after" in said
    assert "lost: NOT taken after" in said
    assert "lost: Look at the host's name" in said
    assert "bare: The server offers no encryption on this port" in said
    assert notify("--test", "--channel", "disk", channels=channels)[0] == 0
    with pytest.raises(ParamError, match="'dsk' is not known here, did you mean 'disk'"):
        notify("--test", "--channel", "dsk", channels=channels)


@pytest.mark.parametrize(
    ("replies", "advice"),
    [
        ({"RCPT": "550 5.1.1 unknown to the DNS here"}, "Look at the recipient's address."),
        ({"MAIL": "550 STARTTLS is not what I want"}, None),
    ],
)
def test_what_a_server_writes_does_not_choose_the_advice(notify, replies, advice):
    with SmtpServer(replies=replies) as server:
        said = notify("--test", channels={"office": {"type": "smtp", "to": "a@b.org", "port": server.port}})[1]
    assert said.splitlines()[-1].startswith("office: NOT taken" if advice is None else f"office: {advice}")


def test_it_uses_what_the_nodes_were_started_with(notify, outbox, tmp_path):
    mail = MailParams(transport="maildir", maildir=str(tmp_path / "house"))
    write_settings(outbox.folder, Settings(who="/patrolling_node", pid=1, wall=1.0, mail=mail))
    status, said = notify("--test")
    assert status == 0
    assert "Channels as /patrolling_node was started." in said
    assert f"the Maildir {tmp_path}/house" in said


def test_what_waits_is_listed_and_why_and_flushed_once_it_can_be(notify, outbox, tmp_path):
    assert "No notices wait" in notify("--list")[1]
    put(outbox, "a", "b")
    with socket.create_server(("localhost", 0)) as free:
        port = free.getsockname()[1]
    channels = {"server": {"type": "smtp", "to": "a@b.org", "port": port}}
    status, said = notify("--flush", channels=channels)
    assert status == 1
    assert "nothing listens there" in said
    assert "2 notices wait still." in said
    status, said = notify("--list")
    assert status == 0
    assert "2 notices wait in" in said
    assert "server: a@b.org through the mail server" in said
    assert "2 wait since" in said
    assert "because the mail server" in said
    assert "incident  a  rosbot patrol node" in said
    with SmtpServer(port=port) as server:
        status, said = notify("--flush", channels=channels)
        assert (status, len(server.mails)) == (0, 2)
        assert "Nothing waits." in said


def test_where_a_node_delivers_it_is_asked_to(notify, outbox, tmp_path, monkeypatch):
    put(outbox, "a")
    node = FileLock(outbox.folder / "lock", "/patrolling_node")
    assert node.take()
    monkeypatch.setattr(notify_tool, "FLUSH_WAIT", 0.1)
    status, said = notify("--flush")
    assert status == 1
    assert "/patrolling_node (process" in said
    assert (outbox.folder / "flush").exists()


def test_where_nothing_waits_no_node_is_waited_for(notify, outbox):
    node = FileLock(outbox.folder / "lock", "/patrolling_node")
    assert node.take()
    status, said = notify("--flush")
    assert status == 0
    assert "Nothing waits." in said
    assert not (outbox.folder / "flush").exists()


def test_no_outbox_is_no_fault(notify):
    status, said = notify("--list")
    assert status == 0
    assert "no node has used it yet" in said


def test_each_recipient_is_tried_and_listed_by_itself(notify, outbox):
    with SmtpServer(recipients={"b@b.org": ["550 5.1.1 no such user"], "c@b.org": ["451 later"]}) as server:
        channels = {"office": {"type": "smtp", "to": "a@b.org, b@b.org, c@b.org", "port": server.port, "interval": 0}}
        status, said = notify("--test", "--channel", "office", channels=channels)
        assert status == 1
        assert "office:a@b.org: taken after" in said
        assert "office:b@b.org: Look at the recipient's address." in said
        assert notify("--test", "--channel", "office:a@b.org", channels=channels)[0] == 0
        with pytest.raises(ParamError, match=r"did you mean 'office:a@b\.org'"):
            notify("--test", "--channel", "office:a@b.or", channels=channels)
        put(outbox, "n1")
        assert notify("--flush", channels=channels)[0] == 1
        said = notify("--list")[1]
    assert "office:a@b.org: a@b.org through the mail server" in said
    assert "refused the last notice for good: localhost" in said
    assert "1 waits since" in said
    assert "451 later" in said
