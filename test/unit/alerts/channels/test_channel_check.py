from rosbot_patrol.alerts.channels.channel import FailureCause
from rosbot_patrol.alerts.channels.channel_check import ChannelCheck


def test_every_cause_that_has_a_name_has_advice():
    for cause in FailureCause:
        tested = ChannelCheck(channel="a", text="", seconds=0.0, cause=cause)
        assert bool(tested.advice) is (cause is not FailureCause.OTHER)
    assert ChannelCheck(channel="a", text="", seconds=0.0).advice == ""
