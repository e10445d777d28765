"""The channels of the parameters and of the file, and every mistake in them."""

import json
from pathlib import Path

import pytest

from rosbot_patrol.alerts.channels.config import Surroundings, load_channels, make_channels
from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.channels.secrets_on_disk import read_secret, refuse_secrets
from rosbot_patrol.alerts.channels.transports import sendmail
from rosbot_patrol.alerts.dispatch.settings_file import Settings, differences, read_settings, write_settings
from rosbot_patrol.errors import ParamError

ROOT = Path(__file__).resolve().parents[4]


def around(tmp_path, **environ):
    return Surroundings(home=tmp_path, environ=environ, host="robot")


def choose(tmp_path, environ=None, **given):
    return make_channels(MailParams(**given), around(tmp_path, **(environ or {})))


@pytest.fixture
def program(tmp_path):
    path = tmp_path / "sendmail"
    path.write_text("#!/bin/sh\n")
    path.chmod(0o755)
    return str(path)


def file(tmp_path, channels):
    path = tmp_path / "channels.yaml"
    path.write_text(channels if isinstance(channels, str) else json.dumps({"channels": channels}), encoding="utf-8")
    return path


def private(tmp_path, text="geheim\n", mode=0o600):
    path = tmp_path / "secret"
    path.write_text(text)
    path.chmod(mode)
    return str(path)


def test_auto_takes_sendmail_for_a_real_address(tmp_path, program):
    for to, name in (("a@b.org", "sendmail"), ("*****@****.***", "maildir"), ("", "maildir")):
        (channel,) = choose(tmp_path, email_to=to, sendmail=program)
        assert (channel.name, channel.transport.name) == ("mail", name)


def test_auto_without_a_sendmail_takes_the_maildir(tmp_path, monkeypatch):
    monkeypatch.setattr(sendmail, "SENDMAILS", ())
    (channel,) = choose(tmp_path, email_to="a@b.org")
    assert channel.transport.describe() == f"the Maildir {tmp_path}/rosbot_patrol/mail"


def test_the_tutorials_parameters_set_the_pace(tmp_path):
    (channel,) = choose(tmp_path, mail_interval=3.0, mail_retry=0.5)
    assert (channel.pace.interval, channel.pace.first_delay, channel.kinds) == (3.0, 0.5, ())


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"transport": "sendmail", "sendmail": "/nowhere/sendmail", "email_to": "a@b.org"}, "~sendmail: no program"),
        ({"transport": "smtp"}, "~email_to: expected a real address for smtp"),
        ({"transport": "smtp", "email_to": "a@b.org", "smtp_user": "me"}, "~smtp_security: expected starttls or tls"),
        (
            {"transport": "smtp", "email_to": "a@b.org", "smtp_user": "me", "smtp_security": "tls"},
            "~smtp_password_file: needs a password, from this file or the variable ROSBOT_PATROL_SMTP_PASSWORD",
        ),
        ({"transport": "smtp", "email_to": "a@b.org", "smtp_ca_file": "/nowhere"}, "ca_file: /nowhere cannot be read"),
        ({"channels": "/nowhere.yaml"}, "/nowhere.yaml: cannot be read"),
        ({"email_to": "a@b.org\nBcc: x@y.org"}, "~email_to: has a line break"),
        ({"email_from": "a@b.org\x85x"}, "~email_from: has a line break"),
    ],
)  # fmt: skip
def test_what_a_channel_lacks_is_a_sentence(tmp_path, given, said):
    with pytest.raises(ParamError, match=said):
        choose(tmp_path, **given)


def test_more_channels_by_a_file(tmp_path):
    channels = {
        "phone": {"type": "webhook", "url": "https://x.org/h", "secret_file": private(tmp_path), "kinds": ["incident"]},
        "disk": {"type": "maildir", "folder": str(tmp_path / "m"), "interval": 0},
        "office": {"type": "smtp", "to": "a@b.org", "host": "mail", "port": 587, "security": "starttls", "user": "u",
                   "password_env": "OFFICE"},
    }  # fmt: skip
    made = choose(tmp_path, {"OFFICE": "pw"}, channels=str(file(tmp_path, channels)))
    assert [c.name for c in made] == ["mail", "phone", "disk", "office"]
    assert made[1].kinds == ("incident",)
    assert made[2].pace.interval == 0.0
    assert made[3].transport.describe() == "a@b.org through the mail server mail:587"


def test_a_channel_called_mail_takes_the_place_of_the_parameters(tmp_path):
    path = file(tmp_path, {"mail": {"type": "maildir", "folder": "/m"}})
    (channel,) = choose(tmp_path, transport="smtp", channels=str(path))
    assert channel.transport.describe() == "the Maildir /m"


WEB = {"type": "webhook", "url": "https://x.org/"}


@pytest.mark.parametrize(
    ("channels", "said"),
    [
        ({}, "channels.yaml: channels: expected one group of keys for each channel"),
        ("channels: [a]", "channels: expected one group of keys for each channel"),
        ("chanels: {}", "channels.yaml: chanels: 'chanels' is not known here, did you mean 'channels'"),
        ("channels: {a: {type: maildir}, a: {type: maildir}}", "is no valid yaml at line 1"),
        ({"a b": WEB}, "channels/a b: expected a name of letters"),
        ({"a": 3}, "channels/a/: expected a group of keys, got 3"),
        ({"a": {}}, "channels/a/type: is missing, expected one of apprise, maildir, sendmail, smtp, webhook"),
        ({"a": {"type": "pigeon"}}, "channels/a/type: is 'pigeon', expected one of"),
        ({"a": {"type": "webhook"}}, "channels/a/url: is missing"),
        ({"a": {**WEB, "kind": ["incident"]}}, "channels/a/kind: 'kind' is not known here, did you mean 'kinds'"),
        ({"a": {**WEB, "kinds": ["intruder"]}}, "channels/a/kinds: is 'intruder', expected one of incident, verdict"),
        ({"a": {**WEB, "url": "https://me:pw@x.org/"}}, "channels/a/url: has a user or password in it"),
        ({"a": {**WEB, "interval": -1}}, "channels/a/interval: is -1.0, expected at least 0"),
        ({"a": {**WEB, "secret": "geheim"}}, "channels/a/secret: a password may not stand in this file"),
        ({"a": {**WEB, "secret_file": "/nowhere"}}, "channels/a/secret_file: /nowhere cannot be read: No such file"),
        ({"a": {**WEB, "token_env": "NONE"}}, "channels/a/token_file: needs a password, from this file or the"),
        ({"a": {"type": "smtp", "to": "nobody at home"}}, "channels/a/to: expected a mail address"),
        ({"a": {"type": "smtp", "to": "*@*"}}, "channels/a/to: expected"),
        ({"a": {"type": "smtp", "to": "a@b.org", "from": "x\ny"}}, "channels/a/from: has a line break"),
        ({"a": {"type": "smtp", "to": "a@b.org", "user": "u"}}, "channels/a/security: expected starttls or tls where"),
        ({"a": {"type": "sendmail", "to": "a@b.org", "program": "/none"}}, "channels/a/program: no program at /none"),
        ({"mail": {**WEB, "kinds": ["sensor"]}}, "no channel takes the kind 'incident'"),
    ],
)  # fmt: skip
def test_every_mistake_is_named_with_file_and_key(tmp_path, channels, said):
    with pytest.raises(ParamError) as caught:
        choose(tmp_path, channels=str(file(tmp_path, channels)))
    assert said in str(caught.value)
    assert "geheim" not in str(caught.value)


def test_a_password_comes_from_a_private_file_or_the_environment(tmp_path):
    for mode in (0o644, 0o640, 0o604, 0o620):
        with pytest.raises(ParamError, match="can be read by others, expected mode 600"):
            read_secret("~x", private(tmp_path, mode=mode), "", {})
    assert read_secret("~x", private(tmp_path), "", {}) == "geheim"
    assert read_secret("~x", "", "V", {"V": "other"}) == "other"
    for text, said in (("", "is empty"), ("a\tb\n", "holds a line break or control character")):
        with pytest.raises(ParamError, match=said):
            read_secret("~x", private(tmp_path, text), "", {})


@pytest.mark.parametrize("key", ["smtp_password", "password", "webhook_secret", "token", "API_KEY", "mail/password"])
def test_a_password_among_the_parameters_is_refused_and_not_repeated(key):
    group, _, inner = key.rpartition("/")
    tree = {inner: "geheim"} if not group else {group: {inner: "geheim"}}
    with pytest.raises(ParamError, match=f"/node/{key}: a password may not stand there; put it into a file") as caught:
        refuse_secrets(tree, name="/node/", place="there")
    assert "geheim" not in str(caught.value)
    refuse_secrets({"smtp_password_file": "/x", "smtp_user": "me", "keys": {"2": "x"}}, name="/node/", place="there")


def test_the_file_that_is_shipped_is_one(tmp_path, monkeypatch):
    """With its comments taken away: every example in it holds."""
    text = (ROOT / "config" / "channels.yaml").read_text(encoding="utf-8")
    lines = [line[2:] if line.startswith("# ") and line[2:3] in " c" else line for line in text.splitlines()]
    shown = "\n".join(line for line in lines if not line.startswith("#"))
    for name in ("smtp_password", "webhook_secret", "push_url"):
        (tmp_path / name).write_text("ntfys://ntfy.example.org/topic" if name == "push_url" else "x")
        (tmp_path / name).chmod(0o600)
    path = file(tmp_path, shown.replace("~/.config/rosbot_patrol", str(tmp_path)))
    made = load_channels(path, around(tmp_path))
    assert {c.transport.name for c in made} == {"smtp", "webhook", "apprise", "maildir"}


def test_programs_that_were_told_different_things_are_named(tmp_path):
    import os

    mine = MailParams(email_to="a@b.org")
    write_settings(tmp_path, Settings(who="/patrolling_node", pid=os.getppid(), wall=5.0, mail=mine))
    write_settings(tmp_path, Settings(who="/gone", pid=2**22 - 1, wall=4.0, mail=MailParams(email_to="old@b.org")))
    (tmp_path / "settings-broken.json").write_text("{")
    assert [s.who for s in read_settings(tmp_path)] == ["/patrolling_node", "/gone"]
    assert read_settings(tmp_path)[0].mail == mine
    assert differences(tmp_path, "/sensor_watch", mine) == []
    (said,) = differences(tmp_path, "/sensor_watch", MailParams(transport="smtp", email_to="a@b.org"))
    assert said == "/patrolling_node has other values than /sensor_watch for transport: one delivers for both"


HOOK = {"type": "webhook", "url": "http://hass.example.org/x", "token_env": "TOKEN"}
LOGIN = {"type": "smtp", "to": "a@b.org", "host": "mail", "user": "u", "password_env": "TOKEN", "security": "none"}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (HOOK, "channels/a/url: expected https://hass.example.org/... where a token is given"),
        ({**HOOK, "url": "http://10.0.0.2:8123/x"}, "expected https://10.0.0.2:8123/... where a token"),
        ({**HOOK, "url": "http://localhost.evil.org/x"}, "expected https://localhost.evil.org/..."),
        ({**HOOK, "url": "http://[::ffff:10.0.0.1]/x"}, "expected https://"),
        ({**HOOK, "url": "http://127.0.0.1.nip.io/x"}, "expected https://"),
        (LOGIN, "channels/a/security: expected starttls or tls where user is given: without, everybody on the way"),
        ({**LOGIN, "security": "auto", "host": "localhost"}, "security: expected starttls or tls where user is given"),
        ({**LOGIN, "security": "auto", "allow_plaintext": True}, "security: expected starttls or tls where user"),
    ],
)
def test_no_token_or_login_leaves_the_machine_in_clear_text(tmp_path, given, said):
    with pytest.raises(ParamError) as caught:
        choose(tmp_path, {"TOKEN": "geheim"}, channels=str(file(tmp_path, {"a": given})))
    assert said in str(caught.value)
    assert "allow_plaintext: true" in str(caught.value) or given.get("security") == "auto"


@pytest.mark.parametrize(
    "given",
    [
        {**HOOK, "allow_plaintext": True},
        {**HOOK, "url": "https://hass.example.org/x"},
        {"type": "webhook", "url": "http://hass.example.org/x", "secret_env": "TOKEN"},  # it is not sent
        *({**HOOK, "url": f"http://{host}/x"} for host in ("localhost", "LOCALHOST.:80", "127.8.9.1", "[::1]:81")),
        {**LOGIN, "allow_plaintext": True},
        {**LOGIN, "host": "127.0.0.1"},
        {**LOGIN, "host": "::1"},
    ],
)
def test_what_stays_here_or_is_asked_for_goes_in_clear_text(tmp_path, given):
    assert len(choose(tmp_path, {"TOKEN": "geheim"}, channels=str(file(tmp_path, {"a": given})))) == 2


@pytest.mark.parametrize(("given", "mode", "is_said"), [(WEB, 0o644, True), (WEB, 0o600, False), (LOGIN, 0o644, False)])
def test_a_file_with_a_webhook_that_others_can_read_is_said(tmp_path, caplog, given, mode, is_said):
    path = file(tmp_path, {"a": {**given, "host": "localhost"} if given is LOGIN else given})
    path.chmod(mode)
    load_channels(path, around(tmp_path, TOKEN="x"))
    said = f"{path} can be read by other users, and holds the address of a webhook: chmod 600"
    assert (said in caplog.text) == is_said


def test_the_tutorials_parameters_ask_for_clear_text_by_a_name_of_their_own(tmp_path):
    given = {"transport": "smtp", "email_to": "a@b.org", "smtp_host": "mail", "smtp_user": "u", "smtp_security": "none"}
    variable = {"ROSBOT_PATROL_SMTP_PASSWORD": "geheim"}
    with pytest.raises(ParamError, match=r"~smtp_security: .*smtp_allow_plaintext: true sends it all the same"):
        choose(tmp_path, variable, **given)
    assert choose(tmp_path, variable, **given, smtp_allow_plaintext=True)[0].transport.name == "smtp"
