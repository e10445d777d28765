"""Each recipient has a state of its own: what one delays or refuses concerns no other. Scripted SMTP server."""

from dataclasses import replace

import pytest
from post import Time, deliver_all, notice
from smtp_server import SmtpServer

from rosbot_patrol.alerts.channels.config import Surroundings, make_channels
from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.dispatch.dispatcher import Dispatcher
from rosbot_patrol.alerts.outbox.outbox import Outbox

A, B, C = "a@example.org", "b@example.org", "c@example.org"
LATER, NEVER, GOOD = "451 4.3.0 try later", "550 5.1.1 no such user", "250 ok"


class House:
    """An outbox with the channels of `email_to`, a clock, and a program that may start anew."""

    def __init__(self, folder, port, to=(A, B), **given):
        self.folder, self.time = folder, Time()
        self.params = MailParams(
            **{
                "transport": "smtp",
                "email_to": ", ".join(to),
                "smtp_port": port,
                "mail_timeout": 2.0,
                "mail_interval": 0.0,
                **given,
            }
        )
        self.start()

    def start(self):
        around = Surroundings(home=self.folder, environ={}, host="robot")
        channels = make_channels(self.params, around)
        self.post = Dispatcher(Outbox(self.folder / "outbox"), channels, clocks=self.time.clocks, seed=1, who="test")
        assert self.post.take_over()

    def restart(self):
        self.post.hand_over()
        self.start()

    def put(self, *names, kind="incident"):
        for name in names:
            self.post.outbox.put(notice(name, kind))

    def run(self, seconds=0.0, step=5.0):
        done, until = deliver_all(self.post), self.time.now + seconds
        while self.time.now < until:
            self.time.now += step
            done += deliver_all(self.post)
            self.post.tell_faults()
        return done

    @property
    def waiting(self):
        return [entry.id for entry in self.post.outbox.waiting()]

    def status(self, name):
        return next(s for s in self.post.statuses() if s.name == name)


@pytest.fixture
def house(tmp_path):
    open_ = []

    def make(recipients, to=(A, B), replies=None, **given):
        server = SmtpServer(replies, recipients=recipients)
        open_.append(server)
        return House(tmp_path, server.port, to, **given), server

    yield make
    for server in open_:
        server.__exit__()


def ids(server, to):
    return [mail_id.strip("<>").partition("@")[0] for taker, mail_id in server.took if taker == to]


def test_one_that_is_put_off_is_tried_again_alone_and_nobody_gets_a_second_copy(house):
    made, server = house({B: [LATER, LATER, GOOD]})
    made.put("n1")
    made.run()
    assert (ids(server, A), ids(server, B), made.waiting) == (["n1"], [], ["n1"])
    assert made.status(f"mail:{A}").waiting == 0
    assert LATER in made.status(f"mail:{B}").error
    made.run(60.0)
    assert (ids(server, A), ids(server, B), made.waiting) == (["n1"], ["n1"], [])
    assert server.asked.count(A) == 1


def test_one_that_is_put_off_for_hours_holds_up_nobody(house):
    """A mailbox that is full: the alarms of a week go to the other one at once."""
    made, server = house({B: ["452 4.2.2 mailbox full"]})
    for name in ("n1", "n2", "n3"):
        made.put(name)
        made.run(600.0, step=60.0)
        assert name in ids(server, A)
    assert ids(server, B) == []
    server.recipients[B] = [GOOD]
    made.run(3600.0, step=60.0)
    assert sorted(name for name in ids(server, B) if "-" not in name) == ["n1", "n2", "n3"]
    assert made.waiting == []


def test_one_that_is_refused_for_good_is_told_and_not_asked_again(house, caplog):
    made, server = house({B: [NEVER]})
    made.put("n1")
    made.run(8 * 3600.0, step=60.0)
    assert server.asked.count(B) == 1
    assert [name[:10] for name in ids(server, A)] == ["n1", "n1-refused"]
    assert f"The channel 'mail:{B}'" in server.mails[-1][1].decode()
    assert NEVER in caplog.text
    assert NEVER in made.status(f"mail:{B}").refusal
    assert made.waiting == []
    line = next(line for line in (made.folder / "outbox" / "taken.jsonl").read_text().splitlines() if B in line)
    assert NEVER in line


def test_two_answers_of_two_kinds_are_no_common_verdict(house):
    """550 and 451 together: nothing is final for the second, whichever is asked first."""
    made, server = house({A: [NEVER], B: [LATER, GOOD]})
    made.put("n1")
    assert [d.permanent for d in made.run()] == [True, False]
    made.run(60.0)
    assert ids(server, B)[0] == "n1"
    assert server.asked.count(A) == 1


def test_where_all_refuse_the_notice_is_kept_and_asked_for_now_and_then(house):
    made, server = house({A: [NEVER], B: ["554 5.7.1 rejected"]})
    made.put("n1")
    made.run(600.0, step=30.0)
    assert (server.asked.count(A), server.asked.count(B), made.waiting) == (1, 1, ["n1"])
    server.recipients = {A: [NEVER], B: [GOOD]}  # the server's keeper has mended it
    made.run(3600.0, step=60.0)
    assert ids(server, B)[0] == "n1"
    asked = server.asked.count(A)
    made.run(24 * 3600.0, step=600.0)
    assert server.asked.count(A) == asked
    assert made.waiting == []


def test_a_refusal_is_told_once_until_something_is_taken(house):
    made, server = house({B: [NEVER, NEVER, NEVER, GOOD, NEVER]})
    for i in range(5):
        made.put(f"n{i}")
        made.run(60.0)
    told = [name for name in ids(server, A) if "refused" in name]
    assert [name[:2] for name in told] == ["n0", "n4"]
    assert ids(server, B) == ["n3"]


def test_what_was_taken_and_refused_is_known_after_a_restart(house):
    made, server = house({B: [LATER], C: [NEVER]}, to=(A, B, C))
    made.put("n1")
    made.run()
    for _ in range(3):
        made.restart()
        made.run()
    assert ids(server, A).count("n1") == 1
    assert server.asked.count(C) == 1
    assert NEVER in made.status(f"mail:{C}").refusal
    server.recipients[B] = [GOOD]
    made.restart()
    made.run(60.0)
    assert ids(server, B)[0] == "n1"
    assert ids(server, A).count("n1") == 1
    assert made.waiting == []


def test_greylisting_of_one_of_three(house):
    made, server = house({B: ["450 4.2.0 greylisted"] * 4 + [GOOD]}, to=(A, B, C))
    made.put("n1")
    made.run(600.0)
    assert [ids(server, to) for to in (A, B, C)] == [["n1"]] * 3


@pytest.mark.parametrize("reply", ["421 4.3.2 shutting down", None])
def test_a_connection_that_ends_at_one_recipient(house, reply):
    made, server = house({A: [reply, GOOD]})
    made.put("n1")
    made.run(60.0)
    assert (ids(server, A), ids(server, B)) == (["n1"], ["n1"])


def test_a_server_that_takes_one_recipient_a_mail_gives_it_to_all(house):
    """`452 too many recipients` cannot come: each mail has one."""
    made, server = house({}, to=(A, B, C))
    made.put("n1")
    made.run()
    assert all(len(envelope) == 2 for envelope, _ in server.mails)
    assert sorted(to for to, _ in server.took) == [A, B, C]


@pytest.mark.parametrize(("reply", "later"), [("451 4.3.0 not now", True), ("554 5.6.0 spam", False), (None, True)])
@pytest.mark.parametrize("verb", ["DATA", "."])
def test_data_that_is_refused_after_a_recipient_was(house, verb, reply, later):
    made, server = house({B: [NEVER]}, replies={verb: reply})
    made.put("n1")
    made.run()
    assert server.mails == []
    assert made.waiting == ["n1"]
    server.replies = {}
    made.run(60.0 if later else 1000.0, step=10.0)
    assert ids(server, A)[0] == "n1"
    assert server.asked.count(B) <= 2  # not before somebody had it was the refusal final
    assert "n1" not in made.waiting


def test_a_digest_that_one_takes_and_one_does_not(house):
    made, server = house({B: [LATER, GOOD]})
    made.put("s1", "s2", "s3", kind="sensor")
    made.run(60.0)
    assert len(ids(server, A)) == len(ids(server, B)) == 1
    assert made.waiting == []


def test_a_refusal_that_the_disk_does_not_take_is_written_later(house, monkeypatch):
    made, server = house({B: [NEVER]})
    made.put("n1")
    real = made.post.receipts.add

    def full(receipt):
        if receipt.refused:
            raise OSError(28, "No space left on device")
        real(receipt)

    with monkeypatch.context() as patched:
        patched.setattr(made.post.receipts, "add", full)
        for name in made.post.channels:
            made.post.refresh()
            made.post.deliver(name)
    made.run(60.0)
    assert server.asked.count(B) == 1
    assert made.waiting == []


def test_the_receipts_of_the_version_before_hold_for_all_recipients(house):
    made, server = house({})
    made.put("n1", "n2")
    made.post.hand_over()
    line = '{"channel": "mail", "transport": "smtp", "ids": ["n1"], "wall": 1.0, "where": "a, b"}\n'
    (made.folder / "outbox" / "taken.jsonl").write_text(line)
    made.start()
    made.run()
    assert (ids(server, A), ids(server, B)) == (["n2"], ["n2"])


def test_one_recipient_is_the_channel_itself(house):
    made, _ = house({}, to=(A,))
    assert list(made.post.channels) == ["mail"]
    assert made.post.channels["mail"].names == {"mail", f"mail:{A}"}


def test_taking_the_bad_address_away_sends_the_good_one_nothing_twice(house):
    """What an owner does who reads that an address is not taken."""
    made, server = house({B: [LATER]})
    made.put("n1")
    made.run()
    made.params = replace(made.params, email_to=A)
    made.restart()
    assert list(made.post.channels) == ["mail"]
    made.run(60.0)
    assert ids(server, A) == ["n1"]
    assert made.waiting == []
    made.params = replace(made.params, email_to=f"{A}, {C}")  # and another in its place
    made.restart()
    made.put("n2")
    made.run(60.0)
    assert (ids(server, A), ids(server, C)) == (["n1", "n2"], ["n2"])


def test_a_bad_address_is_asked_once_for_a_digest(house):
    made, server = house({B: [NEVER]})
    made.put(*(f"s{i}" for i in range(50)), kind="sensor")
    made.run(3600.0, step=30.0)
    assert server.asked.count(B) == 1
    assert made.waiting == []


def test_an_address_that_stands_twice_gets_one_copy(house):
    made, server = house({}, to=(A, f"Owner <{A}>", "a@EXAMPLE.org", B, A))
    made.put("n1")
    made.run()
    assert sorted(to for to, _ in server.took) == [A, B]
    (to,) = {line for _, data in server.mails for line in data.decode().splitlines() if line.startswith("To:")}
    assert to == f"To: {A}, {B}"


def test_a_program_that_takes_all_or_nothing_is_asked_for_each_recipient(tmp_path):
    """As msmtp: one bad address among the arguments, and nobody gets the mail."""
    program = tmp_path / "sendmail"
    refuse = 'case "$*" in *b@*) echo no such user >&2; exit 67;; esac'
    program.write_text(f'#!/bin/sh\ncat >/dev/null\nshift 4\n{refuse}\necho "$*" >>{tmp_path}/sent\n')
    program.chmod(0o755)
    made = House(tmp_path, 25, (A, B, C), transport="sendmail", sendmail=str(program))
    made.put("n1")
    made.run()
    assert (tmp_path / "sent").read_text().split()[:2] == [A, C]
    assert "no such user" in made.status(f"mail:{B}").refusal
    assert "n1" not in made.waiting


def test_a_notice_for_the_channel_of_before_goes_to_each_of_its_recipients(house):
    made, server = house({})
    made.post.outbox.put(notice("n1", channels=("mail",)))
    made.run()
    assert (ids(server, A), ids(server, B)) == (["n1"], ["n1"])


def test_names_of_recipients_that_differ_late_are_told_apart(house):
    to = tuple(f"somebody.with.a.name.as.long.as.this.{i}@example.org" for i in range(2))
    made, server = house({address: [NEVER] for address in to}, to=(A, *to))
    made.put("n1")
    made.run(60.0)
    assert len([name for name in ids(server, A) if "refused" in name]) == 2
