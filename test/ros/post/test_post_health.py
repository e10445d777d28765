"""What /diagnostics says of a channel."""

from rosbot_patrol.alerts.dispatch.delivery import ChannelStatus
from rosbot_patrol.ros.post.health import level_and_text
from rosbot_patrol.ros.runtime.diagnostics import OK, WARN

WELL = {"name": "mail", "describe": "a@x.org through the mail server m:25", "since": None, "refused": 0}


def status(**given):
    return ChannelStatus(**{**WELL, "waiting": 0, "down_for": None, "error": "", "next_try": None, **given})


def test_a_recipient_that_refused_the_last_notice_is_a_warning_though_nothing_waits():
    assert level_and_text(status())[0] == OK
    assert level_and_text(status(refusal="550 no such user")) == (
        WARN,
        "the last notice was refused for good: 550 no such user",
    )


def test_what_waits_is_said_first():
    level, text = level_and_text(status(waiting=1, since=0.0, error="451 later", refusal="550 no"))
    assert (level, "1 notice waits since" in text, "451 later" in text) == (WARN, True, True)
