import json
import os

import pytest
from post import Box, Time, channel, deliver_all, dispatcher, notice

from rosbot_patrol.alerts.channels.mail import make_envelope
from rosbot_patrol.alerts.channels.transports.maildir import MaildirTransport
from rosbot_patrol.alerts.dispatch.status_file import NAME
from rosbot_patrol.alerts.outbox.outbox import Outbox


@pytest.fixture
def no_sync(monkeypatch):
    """Many notices, and no crash among them: the disk need not follow."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)


def test_a_notice_goes_to_every_channel_and_is_crossed_out_then(tmp_path):
    mail, phone = Box(), Box()
    post = dispatcher(tmp_path, channel("mail", mail), channel("phone", phone))
    for name in ("a", "b"):
        post.outbox.put(notice(name))
    assert post.take_over()
    done = deliver_all(post)
    assert mail.ids == phone.ids == ["a", "b"]
    assert [d.text for d in done][:1] == ["notice a delivered by box: in the box"]
    assert post.outbox.waiting() == []
    assert sorted(path.name[13:] for path in post.outbox.sent.iterdir()) == ["a.notice", "b.notice"]


def test_a_channel_that_is_down_holds_up_only_itself(tmp_path):
    time = Time()
    mail, phone = Box(time), Box()
    mail.down = "no server"
    post = dispatcher(tmp_path, channel("mail", mail), channel("phone", phone), time=time)
    for name in ("a", "b"):
        post.outbox.put(notice(name))
    post.take_over()
    deliver_all(post)
    assert phone.ids == ["a", "b"]
    assert len(post.outbox.waiting()) == 2
    (status, _) = post.statuses()
    assert (status.name, status.waiting, status.error) == ("mail", 2, "no server")
    assert status.since == 1_790_000_000.0
    mail.down, time.now = "", time.now + 6.5
    deliver_all(post)
    assert (mail.ids, phone.ids) == (["a", "b"], ["a", "b"])
    assert post.outbox.waiting() == []


def test_what_one_channel_took_is_not_sent_to_it_again_after_a_crash(tmp_path):
    mail, phone = Box(), Box()
    phone.down = "no network"
    post = dispatcher(tmp_path, channel("mail", mail), channel("phone", phone))
    post.outbox.put(notice("a"))
    post.take_over()
    deliver_all(post)
    post.lock.release()  # as the system does when the process is killed
    phone.down = ""
    again = dispatcher(tmp_path, channel("mail", mail), channel("phone", phone))
    again.take_over()
    deliver_all(again)
    assert (mail.ids, phone.ids) == (["a"], ["a"])
    assert again.outbox.waiting() == []


def test_one_delivers_and_the_other_takes_over(tmp_path):
    first, second = Box(), Box()
    a, b = (dispatcher(tmp_path, channel("mail", box)) for box in (first, second))
    assert a.take_over()
    assert not b.take_over()
    b.outbox.put(notice("x"))
    assert b.deliver("mail") is None
    deliver_all(a)
    assert first.ids == ["x"]
    a.hand_over()
    assert b.take_over()
    b.outbox.put(notice("y"))
    deliver_all(b)
    assert second.ids == ["y"]
    assert "test (process" in b.lock.holder()


def wait(posts, time, seconds):
    """As their programs do: look for the lock five times a second; who had it in the end."""
    for _ in range(round(seconds * 5)):
        time.now += 0.2
        held = [post for post in posts if post.take_over()]
    return held


def test_one_that_hangs_loses_the_deliveries_to_the_other_and_sends_no_more(tmp_path, caplog):
    time, first, second = Time(), Box(), Box()
    a, b = (dispatcher(tmp_path, channel("mail", box), time=time) for box in (first, second))
    assert a.take_over()
    assert wait((a, b), time, 120.0) == [a]
    a.outbox.put(notice("x"))
    assert wait((b,), time, 19.0) == []
    assert wait((b,), time, 2.0) == [b]
    assert "gave no sign of life for 20 s: taking over" in caplog.text
    deliver_all(b)
    b.outbox.put(notice("y"))
    assert deliver_all(a, look=False) == []  # it goes on
    assert "this program hung: test (process" in caplog.text
    assert wait((a, b), time, 60.0) == [b]
    deliver_all(b)
    assert (first.ids, second.ids) == ([], ["x", "y"])
    b.hand_over()
    assert wait((a,), time, 1.0) == [a]


def test_one_whose_locks_file_was_removed_says_so_and_goes_on(tmp_path, caplog):
    time, box = Time(), Box()
    post = dispatcher(tmp_path, channel("mail", box), time=time)
    assert post.take_over()
    post.lock.path.unlink()
    post.outbox.put(notice("x"))
    assert deliver_all(post, look=False) == []
    assert "was removed, by which others know who delivers: making it anew" in caplog.text
    assert "hung" not in caplog.text
    assert wait((post,), time, 1.0) == [post]
    deliver_all(post)
    assert box.ids == ["x"]


def test_one_that_hangs_in_a_delivery_ends_it_and_nothing_is_lost(tmp_path):
    time, second = Time(), Box()
    b = dispatcher(tmp_path, channel("mail", second), time=time)

    class Hangs(Box):
        def send(self, told):
            if told.id == "x":
                assert wait((b,), time, 25.0) == [b]
                deliver_all(b)
            return super().send(told)

    first = Hangs()
    a = dispatcher(tmp_path, channel("mail", first), time=time)
    a.take_over()
    for name in ("x", "y"):
        a.outbox.put(notice(name))
    (done,) = deliver_all(a)
    assert done.delivered
    assert (first.ids, second.ids) == (["x"], ["x", "y"])  # the one that was under way twice, by the same id
    assert a.outbox.waiting() == []
    assert not a.is_delivering
    assert b.is_delivering


def test_two_that_wait_for_one_that_hangs_do_not_both_take_over(tmp_path):
    time = Time()
    a, b, c = (dispatcher(tmp_path, channel("mail", Box()), time=time) for _ in range(3))
    a.take_over()
    assert len(wait((b, c), time, 60.0)) == 1
    assert sum(post.is_delivering for post in (a, b, c)) == 1


def test_who_slept_itself_does_not_take_anothers_silence_for_a_hang(tmp_path):
    time = Time()
    a, b = (dispatcher(tmp_path, channel("mail", Box()), time=time) for _ in range(2))
    assert wait((a, b), time, 5.0) == [a]
    time.now += 3600.0  # the machine, or this process alone
    assert not b.take_over()
    assert wait((a, b), time, 5.0) == [a]


def test_channels_take_the_kinds_that_they_ask_for(tmp_path, caplog):
    everything, phone = Box(), Box()
    post = dispatcher(
        tmp_path, channel("phone", phone, kinds=("incident",)), channel("mail", everything, kinds=("sensor",))
    )
    for name, kind in (("i", "incident"), ("s", "sensor"), ("v", "verdict")):
        post.outbox.put(notice(name, kind))
    post.take_over()
    deliver_all(post)
    assert (phone.ids, everything.ids) == (["i"], ["s"])
    assert "notice v is of kind 'verdict', which no channel takes" in caplog.text
    assert post.outbox.waiting() == []


def test_an_hour_without_a_server_then_all_in_order_once(tmp_path, no_sync):
    time = Time()
    mail, phone = Box(time), Box()
    post = dispatcher(
        tmp_path, channel("mail", mail, interval=1.0), channel("phone", phone), time=time, down_after=1800.0
    )
    post.take_over()
    mail.down, began, names = "no answer within 30 s", time.now, []
    while time.now - began < 3600.0:
        if len(names) < (time.now - began) / 90.0:
            names.append(f"n{len(names):02d}")
            post.outbox.put(notice(names[-1]))
        time.now += 5.0
        deliver_all(post)
        post.tell_faults()
    assert [i for i in phone.ids if i in names] == names
    assert 15 < mail.tries < 100  # each new notice is a reason to try, and no more than one
    faults = [n for n in phone.taken if n.kind == "fault"]
    assert [n.subject for n in faults] == ["rosbot patrol: the channel 'mail' is down"]
    assert "no answer within 30 s" in faults[0].text
    mail.down, back = "", time.now
    while post.outbox.waiting():
        time.now += 1.0
        deliver_all(post)
    assert mail.ids == names
    assert time.now - back < 900.0 * 1.2 + 2 * len(names)


def test_without_new_notices_a_server_that_is_down_is_tried_ever_more_seldom(tmp_path):
    time, mail = Time(), Box()
    mail.down = "no server"
    post = dispatcher(tmp_path, channel("mail", mail), time=time)
    post.outbox.put(notice("a"))
    post.take_over()
    for _ in range(720):
        time.now += 5.0
        deliver_all(post)
    assert 8 <= mail.tries <= 13
    post.nudge(all_=True)  # the network came back, or somebody asks
    mail.down = ""
    deliver_all(post)
    assert mail.ids == ["a"]


def test_a_notice_refused_for_good_lets_the_others_pass_and_is_told_elsewhere_once(tmp_path):
    time, mail, phone = Time(), Box(), Box()
    post = dispatcher(tmp_path, channel("mail", mail), channel("phone", phone), time=time)
    post.outbox.put(notice("bad"))
    mail.down, mail.permanent = "550 not you", True
    post.take_over()
    (done, _) = deliver_all(post)
    assert done.permanent
    assert "not taken by 'mail' for good" in done.text
    mail.down = ""
    post.outbox.put(notice("good"))
    for _ in range(3):
        deliver_all(post)
        post.tell_faults()
        time.now += 60.0
    assert mail.ids == ["good"]
    assert phone.ids == ["bad", "good", "bad-refused-mail"]
    assert "550 not you" in phone.taken[-1].text
    assert post.statuses()[0].refused == 1
    time.now += 900.0
    deliver_all(post)
    assert mail.ids == ["good", "bad"]


def test_a_storm_of_sensor_notices_is_a_few_digests_and_incidents_stay_alone(tmp_path, no_sync):
    time, mail = Time(), Box()
    post = dispatcher(tmp_path, channel("mail", mail, interval=10.0), time=time)
    post.take_over()
    put = []
    for _ in range(80):
        for _ in range(5 if len(put) < 300 else 0):
            kind = "incident" if len(put) % 75 == 30 else "sensor"
            put.append((f"n{len(put):04d}", kind))
            post.outbox.put(notice(*put[-1]))
        time.now += 1.0
        deliver_all(post)
    assert post.outbox.waiting() == []
    kinds = [n.kind for n in mail.taken]
    assert kinds.count("incident") == 4
    assert len(kinds) < 20
    told = sum(int(n.subject.split()[2]) if n.kind == "digest" else 1 for n in mail.taken)
    assert told == len(put)
    incidents = [i for i, n in enumerate(mail.taken) if n.kind == "incident"]
    for i in incidents:  # order: nothing younger before it
        assert mail.taken[i].id not in mail.taken[i - 1].text
    assert "about n0001" in mail.taken[0].text


def test_the_same_digest_after_a_crash_has_the_same_id(tmp_path):
    mail = Box()
    ids = []
    for name in ("first", "again"):
        post = dispatcher(tmp_path / name, channel("mail", mail))
        for i in range(4):
            post.outbox.put(notice(f"s{i}", "sensor", text=f"text {i}"))
        post.take_over()
        deliver_all(post)
        ids.append(mail.taken[-1].id)
    assert ids[0] == ids[1]
    assert "text 3" in mail.taken[-1].text


def test_a_disk_that_takes_no_receipt_leads_to_no_second_mail_while_the_program_lives(tmp_path, monkeypatch, caplog):
    mail = Box()
    post = dispatcher(tmp_path, channel("mail", mail))
    post.outbox.put(notice("a"))
    post.take_over()

    def full(receipt):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(post.receipts, "add", full)
        assert post.deliver("mail").delivered
        assert "cannot be written down" in caplog.text
        with pytest.raises(OSError, match="No space"):
            post.refresh()
        assert post.deliver("mail") is None
    deliver_all(post)
    assert mail.ids == ["a"]
    assert post.outbox.waiting() == []


def test_a_channel_that_stumbles_over_one_notice_takes_the_others(tmp_path, caplog):
    mail = Box()
    real = mail.send
    mail.send = lambda n: 1 / 0 if n.id == "bad" else real(n)
    post = dispatcher(tmp_path, channel("mail", mail))
    for name in ("bad", "good"):
        post.outbox.put(notice(name))
    post.take_over()
    deliver_all(post)
    assert mail.ids == ["good"]
    assert "ZeroDivisionError" in caplog.text


def test_a_notice_whose_file_is_taken_away_or_spoiled_does_not_stop_the_others(tmp_path):
    mail = Box()
    post = dispatcher(tmp_path, channel("mail", mail))
    for name in ("a", "b", "c"):
        post.outbox.put(notice(name))
    post.take_over()
    files = sorted(tmp_path.glob("*.notice"))
    files[0].unlink()
    files[1].write_bytes(b"\0\0")
    deliver_all(post, look=False)
    deliver_all(post, look=False)
    deliver_all(post)
    assert mail.ids == ["c"]


def test_the_interval_outlives_the_program(tmp_path):
    time, mail = Time(), Box()
    post = dispatcher(tmp_path, channel("mail", mail, interval=10.0), time=time)
    post.outbox.put(notice("a"))
    post.take_over()
    deliver_all(post)
    post.hand_over()
    time.now += 4.0
    post.outbox.put(notice("b"))
    assert post.take_over()
    assert post.deliver("mail") is None
    assert post.pause("mail") == pytest.approx(6.01)
    time.now += 6.0
    assert post.deliver("mail").delivered


def test_how_it_goes_lies_on_disk(tmp_path):
    mail = Box()
    mail.down = "no server"
    post = dispatcher(tmp_path, channel("mail", mail))
    post.outbox.put(notice("a"))
    post.take_over()
    deliver_all(post)
    post.write_status()
    (told,) = json.loads((tmp_path / NAME).read_text())["channels"]
    assert (told["waiting"], told["error"], told["describe"]) == (1, "no server", "a box")


def test_a_channel_that_is_gone_from_the_configuration_holds_nothing_up(tmp_path):
    mail, phone = Box(), Box()
    phone.down = "gone for ever"
    post = dispatcher(tmp_path, channel("mail", mail), channel("phone", phone))
    post.outbox.put(notice("a"))
    post.take_over()
    deliver_all(post)
    post.hand_over()
    without = dispatcher(tmp_path, channel("mail", mail))
    without.take_over()
    assert Outbox(tmp_path).waiting() == []


def test_a_crash_between_taking_and_crossing_out_sends_again_with_the_same_id(tmp_path, monkeypatch):
    """The one window in which a notice comes twice; a Maildir sees that it is there."""

    class Crash(BaseException):
        pass

    def crash(receipt):
        raise Crash

    mail, folder = Box(), tmp_path / "mail"
    disk = MaildirTransport(folder, make_envelope("", ""))
    for stage in range(3):
        post = dispatcher(tmp_path / "outbox", channel("mail", mail), channel("disk", disk))
        post.outbox.put(notice("a"))
        assert post.take_over()
        with monkeypatch.context() as patched:
            if stage < 2:
                patched.setattr(post.receipts, "add", crash)
                for name in post.channels:
                    with pytest.raises(Crash):
                        post.deliver(name)
            else:
                deliver_all(post)
        post.lock.release()
    assert mail.ids == ["a", "a", "a"]
    assert len(list((folder / "new").iterdir())) == 1
    assert post.outbox.waiting() == []


def test_what_was_taken_long_ago_and_waits_for_another_channel_is_not_forgotten(tmp_path):
    mail, phone = Box(), Box()
    phone.down = "no network"
    channels = channel("mail", mail), channel("phone", phone)
    post = dispatcher(tmp_path, *channels)
    post.outbox.put(notice("old"))
    post.take_over()
    deliver_all(post)
    post.hand_over()
    line = {"channel": "mail", "transport": "box", "wall": 1.0, "where": "there"}
    with (tmp_path / "taken.jsonl").open("a") as file:
        file.writelines(json.dumps({**line, "ids": [f"n{i}"]}) + "\n" for i in range(600))
    for _ in range(2):
        again = dispatcher(tmp_path, *channels)
        again.take_over()
        deliver_all(again)
        again.hand_over()
    assert len((tmp_path / "taken.jsonl").read_text().splitlines()) == 501
    assert mail.ids == ["old"]
