import random

import pytest

from rosbot_patrol.alerts.channels.channel import DeliveryError, Pace
from rosbot_patrol.alerts.dispatch.channel_queue import ChannelQueue
from rosbot_patrol.alerts.outbox.outbox import Waiting


def entries(*names):
    """Those that begin with "s" are of sensors, others of incidents."""
    kinds = {name: "sensor" if name.startswith("s") else "incident" for name in names}
    return [
        Waiting(name=f"{i:012d}-{name}.notice", id=name, kind=kinds[name], wall=i, is_urgent=kinds[name] == "incident")
        for i, name in enumerate(names)
    ]


def queue(*names, **pace):
    made = ChannelQueue(Pace(**{"interval": 0.0, "jitter": 0.0, **pace}), random.Random(1))
    made.offer(entries(*names))
    return made


def drain(made, now=0.0):
    sent = []
    while batch := made.due(now):
        sent.append("+".join(entry.id for entry in batch))
        made.delivered(batch, now)
    return sent


def test_incidents_leave_one_by_one_in_order():
    assert drain(queue("b", "a", "c")) == ["b", "a", "c"]


def test_the_interval_delays_and_never_drops():
    made = queue("a", "b", interval=10.0)
    made.delivered(made.due(100.0), 100.0)  # at once, however lately the program began
    assert made.due(109.0) == []
    assert made.wait(109.0) == pytest.approx(1.0)
    assert [e.id for e in made.due(110.0)] == ["b"]


def test_a_channel_that_is_down_is_tried_ever_more_seldom_and_keeps_the_order():
    made, now, delays = queue("a", "b", first_delay=5.0, max_delay=60.0), 0.0, []
    for _ in range(7):
        delays.append(made.failed(made.due(now), now, DeliveryError("down")))
        assert made.due(now + delays[-1] - 0.01) == []
        now += delays[-1]
    assert delays == [5, 10, 20, 40, 60, 60, 60]
    assert made.down_since == 0.0
    assert drain(made, now) == ["a", "b"]
    assert (made.down_since, made.error) == (None, "")


def test_delays_are_left_to_chance_a_little_and_bounded():
    made, delays = queue("a", first_delay=100.0, jitter=0.2), []
    for _ in range(30):
        delays.append(made.failed(made.due(1e9), 1e9, DeliveryError("down")))
        made.nudge(1e9, all_=True)
    assert 80 <= delays[0] <= 120
    assert len(set(delays)) > 3
    assert max(delays) == 900.0


def test_the_other_sides_wish_is_heeded_within_bounds():
    made = queue("a")
    assert made.failed(made.due(0.0), 0.0, DeliveryError("503", delay=120.0)) == 120.0
    assert made.failed(made.due(120.0), 120.0, DeliveryError("503", delay=1e9)) == 900.0


def test_the_other_sides_wish_outlasts_a_new_notice_but_not_somebody_who_asks():
    made = queue("a", first_delay=5.0)
    made.failed(made.due(0.0), 0.0, DeliveryError("429", delay=64.57))
    made.nudge(10.0)
    assert made.due(64.5) == []
    assert [e.id for e in made.due(64.57)] == ["a"]
    made.nudge(11.0, all_=True)
    assert [e.id for e in made.due(11.0)] == ["a"]
    made.failed(made.due(65.0), 65.0, DeliveryError("no server"))  # the old wish is over
    made.nudge(70.0)
    assert made.due(70.0)


def test_a_wish_shorter_than_our_own_pause_changes_nothing():
    made = queue("a", first_delay=5.0)
    assert made.failed(made.due(0.0), 0.0, DeliveryError("429", delay=0.0)) == 5.0
    assert made.failed(made.due(5.0), 5.0, DeliveryError("429", delay=3.0)) == 10.0


def test_a_new_notice_tries_again_but_does_not_hammer():
    made, now = queue("a", first_delay=5.0), 0.0
    for _ in range(8):
        now += made.failed(made.due(now), now, DeliveryError("down"))
    made.nudge(now - 1.0)  # the last try is 300 s ago
    assert made.due(now - 1.0)
    made.failed(made.due(now), now, DeliveryError("down"))
    made.nudge(now + 1.0)
    assert made.due(now + 1.0) == []
    assert made.due(now + 5.0)


def test_what_is_refused_for_good_lets_the_others_pass_and_is_tried_rarely():
    made = queue("bad", "good")
    assert made.failed(made.due(0.0), 0.0, DeliveryError("550 no", permanent=True)) == 900.0
    assert drain(made, 1.0) == ["good"]
    assert made.wait(1.0) == pytest.approx(899.0)
    assert [(e.id, error) for e, error in made.refused] == [("bad", "550 no")]
    assert made.failed(made.due(900.0), 900.0, DeliveryError("550 no", permanent=True)) == 1800.0
    made.nudge(901.0, all_=True)
    assert [e.id for e in made.due(901.0)] == ["bad"]


def test_a_storm_of_sensors_becomes_digests():
    made, sent = queue(interval=10.0), []
    names = []
    for tenth in range(900):  # 1000 within a minute, then silence
        now = tenth / 10
        if now < 60.0:
            names += [f"s{len(names) + i}" for i in range(5 if tenth % 3 else 0)][: 1000 - len(names)]
            made.offer(entries(*names))
        while batch := made.due(now):
            sent.append(len(batch))
            taken = {e.id for e in batch}
            names = [name for name in names if name not in taken]
            made.delivered(batch, now)
    assert names == []
    assert len(sent) <= 10
    assert sent[0] <= 5


def test_an_incident_is_never_merged_and_waits_for_no_sensor():
    made = queue("s0", interval=10.0)
    assert drain(made, 0.0) == ["s0"]
    made.offer(entries("s1", "s2", "s3", "i1", "s4", "i2"))
    assert drain(made, 1.0) == ["s1+s2+s3", "i1"]  # what stands before it leaves at once: the order is kept
    assert made.wait(1.0) == pytest.approx(10.0)
    assert drain(made, 11.0) == ["s4", "i2"]


def test_of_two_sensor_notices_each_is_a_message():
    assert drain(queue("s1", "s2")) == ["s1", "s2"]


def test_a_digest_that_is_refused_is_taken_apart():
    made = queue("s1", "s2", "s3")
    assert made.failed(made.due(0.0), 0.0, DeliveryError("552 too large", permanent=True)) == 0.0
    assert drain(made) == ["s1", "s2", "s3"]


def test_a_digest_to_a_recipient_that_is_refused_is_one_try_and_the_next_waits_for_the_interval():
    made = queue("s1", "s2", "s3", interval=10.0)
    refusal = DeliveryError("550 no such user", permanent=True, of_recipient=True)
    assert made.failed(made.due(0.0), 0.0, refusal) == 900.0
    assert len(made.refused_for_good) == 3
    made.offer(entries("s1", "s2", "s3", "i1"))
    assert made.due(9.0) == []
    assert [e.id for e in made.due(10.0)] == ["i1"]


def test_a_digest_that_a_refusing_recipient_does_not_want_now_is_not_taken_apart_either():
    made = queue("s1")
    made.failed(made.due(0.0), 0.0, DeliveryError("550 no such user", permanent=True, of_recipient=True))
    made.offer(entries("s1", "s2", "s3"))
    batch = made.due(900.0)
    assert len(batch) == 3
    assert made.failed(batch, 900.0, DeliveryError("450 later", answered=True, of_recipient=True)) == 1800.0
    assert len(made.refused) == 3
    assert made.refused_for_good == []


def test_nothing_to_do_is_no_time():
    assert queue().wait(5.0) is None


def serve(made, now, wants, patience=1000.0):
    """Try what is due until nothing is; returns what was taken, and when all is quiet."""
    taken = []
    for _ in range(200):
        batch = made.due(now)
        if not batch:
            wait = made.wait(now)
            if wait is None or wait > patience:
                break
            now += wait
        elif all(wants(entry.id, now) for entry in batch):
            taken += [entry.id for entry in batch]
            made.delivered(batch, now)
        else:
            made.failed(batch, now, DeliveryError("500 no", answered=True))
    return taken, now


def test_one_that_is_never_wanted_does_not_hold_up_the_others_for_ever():
    made = queue("bad", "b", "c", first_delay=1.0)
    taken, now = serve(made, 0.0, lambda name, _: name != "bad", patience=800.0)
    assert taken == ["b", "c"]
    assert now < 200.0
    assert [entry.id for entry, _ in made.refused] == ["bad"]


def test_a_server_that_wants_nothing_for_an_hour_gets_all_then():
    made = queue("a", "b", "c", first_delay=5.0)
    taken, now = serve(made, 0.0, lambda _, now: now >= 3600.0)
    assert sorted(taken) == ["a", "b", "c"]
    assert taken.index("a") <= 1
    assert now < 3600.0 + 900.0


def test_a_server_that_is_not_there_never_changes_the_order():
    made, now = queue("a", "b", first_delay=1.0), 0.0
    for _ in range(20):
        assert made.due(now)[0].id == "a"
        now += made.failed(made.due(now), now, DeliveryError("refused"))
    assert drain(made, now) == ["a", "b"]
