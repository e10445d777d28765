import pytest

from rosbot_patrol.alerts.mail import build_mail
from rosbot_patrol.alerts.notice import Notice
from rosbot_patrol.alerts.outbox import Outbox
from rosbot_patrol.alerts.postman import Postman
from rosbot_patrol.alerts.transports import DeliveryError, MaildirTransport


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


class Down:
    name = "down"

    def send(self, incident_id, mail):
        clock.now += 30.0  # a time-out
        raise DeliveryError("the server does not answer")

    def describe(self):
        return "nowhere"


clock = Clock()


@pytest.fixture
def outbox(tmp_path):
    return Outbox(tmp_path / "outbox", interval=0.0, first_delay=5.0)


def notice(name="20261121T010203Z-sensors1", subject="sensor 3 is silent"):
    return Notice(id=name, wall=1_790_000_000.0, kind="sensor", subject=subject, text="text\n")


def test_a_mail_is_delivered_once_and_put_off_from_the_end_of_a_failure(tmp_path, outbox, envelope):
    postman = Postman(outbox, Down(), envelope, clock)
    postman.put(notice("n1"))
    done = postman.deliver()
    assert not done.delivered
    assert "next try in 5 s" in done.text
    assert postman.deliver() is None
    assert postman.wait() == pytest.approx(5.0)
    postman.transport = MaildirTransport(tmp_path / "mail")
    clock.now += 5.0
    assert postman.deliver().delivered
    assert (len(postman), postman.wait(), postman.has("n1")) == (0, None, True)


def test_a_file_that_is_gone_or_no_mail_does_not_stop_the_others(tmp_path, outbox, envelope):
    postman = Postman(outbox, MaildirTransport(tmp_path / "mail"), envelope, clock)
    for name in ("n1", "n2", "n3"):
        postman.put(notice(name))
    files = sorted(outbox.folder.glob("*.eml"))
    files[0].unlink()
    files[1].write_bytes(b"\0\0")
    results = [postman.deliver() for _ in range(3)]
    assert [r.delivered for r in results] == [False, False, True]
    assert "is gone" in results[0].text
    assert "set aside" in results[1].text


@pytest.mark.parametrize("evil", ["a\nBcc: evil@x.org", "a\r\n\r\nbody", "a\0", "x" * 5000])
def test_nothing_in_a_notices_subject_can_inject(envelope, evil):
    mail = build_mail(notice(subject=evil), envelope)
    text = mail.as_bytes().decode()
    assert mail["Bcc"] is None
    assert "\nBcc:" not in text
    assert len(mail["Subject"]) <= 200
    assert mail.get_content() == "text\n"
    assert mail["Message-ID"] == "<20261121T010203Z-sensors1@example.org>"
