import random

import pytest
from sensor_house import STEP, House, Speaker, brief

from rosbot_patrol.sensors.problems import Link
from rosbot_patrol.sensors.sensor_file import SensorSpec


def test_a_well_house_says_nothing():
    house = House(1, 2, 3)
    assert house.run(900.0) == []
    assert [s.problems for s in house.watch.statuses()] == [(), (), ()]


def test_silence_is_told_once_and_its_end_once():
    house = House(1, 2)
    house.run(60.0)
    house.speaker(2).beat = None
    assert house.run(9.75) == []
    assert house.run(300.0) == [("silent", 2, True)]
    event = house.events[-1]
    assert event.text == "sensor 2 in room 2 (place 2) is silent: nothing was heard for more than 10 s"
    assert house.watch.age(event.problem.since) == pytest.approx(310.0, abs=1.0)
    house.speaker(2).beat = 0.5
    assert house.run(4.5) == []  # a single message is not a sensor that works
    assert house.run(10.0) == [("silent", 2, False)]
    assert "is well again: silent for 5 min" in house.events[-1].text


def test_a_single_message_does_not_end_a_silence():
    house = House(1)
    house.run(10.0)
    house.speaker(1).beat = None
    assert house.run(20.0) == [("silent", 1, True)]
    for _ in range(3):
        house.watch.heard(1, "/somebody", house.now, move=True)
        assert house.run(20.0) == []
    assert house.wrong() == ["silent/1"]


def test_a_blip_is_nothing():
    house = House(1)
    house.run(20.0)
    house.speaker(1).beat = None
    house.run(8.0)
    house.speaker(1).beat = 0.5
    assert house.run(600.0) == []
    assert house.events == []


def test_never_heard_since_the_start():
    house = House(1, 2)
    house.speaker(2).beat = None
    assert house.run(59.0) == []
    waiting = {s.sensor_id: s.waiting for s in house.watch.statuses()}
    assert waiting == {1: False, 2: True}
    assert house.run(30.0) == [("silent", 2, True)]
    assert house.events[-1].text.endswith("is silent: it has not been heard since the start")


def test_a_sensor_of_motion_only_and_one_out_of_service_may_be_silent():
    house = House(specs=[SensorSpec(id=1, room=1, heartbeat=0.0), SensorSpec(id=2, room=2, enabled=False)])
    assert house.run(1000.0) == []
    house.watch.heard(1, "/script", house.now, move=True)
    assert house.run(1000.0) == []


def test_slow_heartbeats_have_their_own_limit():
    house = House(specs=[SensorSpec(id=1, room=1, heartbeat=30.0)])
    house.speakers = [Speaker(1)]
    house.speakers[0].beat = 30.0
    assert house.run(1000.0) == []
    house.speakers[0].beat = None
    assert house.run(85.0) == []
    assert house.run(40.0) == [("silent", 1, True)]


def test_without_a_file_only_who_sent_heartbeats_can_fall_silent():
    house = House(3, listed=False)
    house.watch.heard(5, "/rostopic_77", house.now, move=True)  # rostopic pub -1
    assert house.run(300.0) == []
    house.speaker(3).beat = None
    assert house.run(60.0) == [("silent", 3, True)]
    assert {s.sensor_id: s.watched for s in house.watch.statuses()} == {3: True, 5: False}


def test_flapping_is_told_instead_of_looking_well():
    house = House(1, flap_count=4)
    house.run(30.0)
    told = []
    for _ in range(8):
        house.speaker(1).beat = None
        told += house.run(4.0)
        house.speaker(1).beat = 0.5
        told += house.run(10.0)
    assert told == [("flapping", 1, True)]
    assert house.events[-1].text.endswith("comes and goes: 4 drop-outs within 42 s")
    assert house.run(250.0) == []
    assert house.run(60.0) == [("flapping", 1, False)]


def test_a_sensor_that_reboots_again_and_again_flaps_though_it_is_never_away_for_long():
    house = House(1)
    house.run(30.0)
    told = []
    for port in range(5001, 5008):
        house.speaker(1).beat = None
        told += house.run(1.5)
        house.speaker(1).beat, house.speaker(1).peer = 0.5, f"10.0.0.1:{port}"
        told += house.run(8.5)
    assert told == [("flapping", 1, True)]


def test_stuck_on_by_level_or_by_calling_without_end():
    house = House(1, 2)
    house.speaker(1).move = True  # reports its level
    told = []
    for _ in range(14):  # reports each rise, of which noise on its supply makes many
        house.watch.heard(2, "/esp_client1", house.now, move=True)
        told += house.run(60.0)
    assert sorted(told) == [("stuck_on", 1, True), ("stuck_on", 2, True)]
    house.speaker(1).move = False
    assert sorted(house.run(100.0)) == [("stuck_on", 1, False), ("stuck_on", 2, False)]


def test_somebody_who_lives_there_is_no_stuck_sensor():
    house = House(1)
    rng = random.Random(3)
    for _ in range(30):  # an hour of coming and going
        house.watch.heard(1, "/esp_client1", house.now, move=True)
        house.run(rng.uniform(20.0, 220.0) // STEP * STEP)
    assert house.events == []


def test_no_motion_for_very_long():
    house = House(specs=[SensorSpec(id=1, room=1, heartbeat=5.0)], no_motion_after=3600.0)
    house.speakers = [Speaker(1)]
    house.speakers[0].beat = 5.0
    assert house.run(3590.0) == []
    assert house.run(20.0) == [("no_motion", 1, True)]
    house.watch.heard(1, "/esp_client1", house.now, move=True)
    assert house.run(1.0) == [("no_motion", 1, False)]


def test_unknown_id_is_told_once_and_forgotten_after_a_while():
    house = House(1)
    house.speakers.append(Speaker(9))
    assert house.run(60.0) == [("unknown_id", 9, True)]
    assert house.events[-1].text == "sensor 9 is not known: sensors.yaml has no sensor with id 9"
    house.speakers.pop()
    assert house.run(590.0) == []
    assert house.run(20.0) == [("unknown_id", 9, False)]
    assert [s.sensor_id for s in house.watch.statuses()] == [1]


def test_two_peers_with_one_id():
    house = House(1, 2)
    house.run(30.0)
    other = Speaker(1, "10.0.0.66:4000", "/esp_client2")
    house.bridges.add("/esp_client2")
    house.speakers.append(other)
    assert house.run(4.0) == []
    assert house.run(30.0) == [("duplicate_id", 1, True)]
    assert "reported by two at a time: 10.0.0.1:5000 and 10.0.0.66:4000" in house.events[-1].text
    other.beat = None
    assert house.run(25.0) == []
    assert house.run(20.0) == [("duplicate_id", 1, False)]


def test_a_plain_node_that_reports_a_sensors_id_is_a_second_peer_but_a_single_test_is_not():
    house = House(1)
    house.run(10.0)
    house.watch.heard(1, "/rostopic_5", house.now, move=True)
    assert house.run(30.0) == []
    house.speakers.append(Speaker(1, bridge="/rostopic_6"))
    for _ in range(80):
        house.watch.heard(1, "/rostopic_6", house.now, move=False)
        house.run(0.25)
    assert ("duplicate_id", 1, True) in [brief(event) for event in house.events]


def test_a_reconnection_is_no_second_peer():
    house = House(1)
    house.run(30.0)
    house.speaker(1).beat = None
    house.run(1.0)
    house.speakers.append(Speaker(1, "10.0.0.1:5001"))
    assert house.run(300.0) == []


def test_a_peer_that_the_file_does_not_allow():
    house = House(specs=[SensorSpec(id=1, room=1, peers=("10.0.0.0/24",)), SensorSpec(id=2, room=2, peers=("::1",))])
    house.speakers = [Speaker(1), Speaker(2, "[fc94::9]:5000")]
    assert house.run(30.0) == [("wrong_peer", 2, True)]
    assert "speaks from fc94::9" in house.events[-1].text


def test_clocks_of_a_device_and_of_a_bridges_machine():
    house = House(1, 2)
    house.speaker(1).clock, house.speaker(2).clock = 3.0, -4000.0
    assert house.run(9.0) == []
    assert house.run(10.0) == [("clock_off", 2, True)]
    assert house.events[-1].text == "sensor 2 in room 2 (place 2) has a clock that is 67 min behind"
    told = []
    for _ in range(30):
        house.watch.linked("/pc", [], house.now, clock_offset=90.0)
        told += house.run(1.0)
    assert told == [("clock_off", "/pc", True)]
    assert house.events[-1].text == "bridge /pc runs on a machine whose clock is 90 s ahead"


def test_a_patrol_that_says_nothing_more():
    house = House(1, patrol_after=10.0)
    assert house.run(60.0) == []  # one that was never heard is not missed
    for _ in range(5):
        house.watch.patrol_heard("/patrolling_node", house.now)
        assert house.run(5.0) == []
    (gone,) = house.run(20.0)
    assert gone == ("patrol_gone", "/patrolling_node", True)
    text = "has gone, or hangs: nothing is heard of it, and motion is not answered"
    assert house.events[-1].text == f"the patrol (patrolling_node) {text}"
    for _ in range(5):
        house.watch.patrol_heard("/patrolling_node", house.now)
        house.run(1.0)
    assert brief(house.events[-1]) == ("patrol_gone", "/patrolling_node", False)
    assert house.wrong() == []


def test_a_bridge_that_dies_and_comes_back():
    house = House(1, 2, 3)
    house.run(60.0)
    house.bridges.clear()
    told = house.run(30.0)
    assert told[0] == ("bridge_gone", "/esp_client1", True)
    assert sorted(told[1:]) == [("silent", i, True) for i in (1, 2, 3)]
    assert all(e.problem.bridge == "/esp_client1" for e in house.events[1:])
    assert house.watch.bridges() == {"/esp_client1": False}
    house.bridges.add("/esp_client1")
    for s in house.speakers:
        s.peer = s.peer.replace("5000", "5001")
    back = house.run(30.0)
    assert sorted(back) == [("bridge_gone", "/esp_client1", False)] + [("silent", i, False) for i in (1, 2, 3)]
    for _ in range(8):  # however often: the sensors do not flap, their bridge does
        house.bridges.clear()
        house.run(4.0)
        house.bridges.add("/esp_client1")
        house.run(20.0)
    flapping = [brief(e) for e in house.events if e.problem.key.kind_name == "flapping"]
    assert flapping == [("flapping", "/esp_client1", True)]
    house.run(700.0)
    assert house.wrong() == []


def test_whoever_was_asleep_himself_takes_nobody_for_silent():
    house = House(1, 2)
    house.run(30.0)
    house.now += 3600.0
    assert house.run(60.0) == []
    house.now -= 100.0
    for s in house.speakers:
        s.heard = house.now
    assert house.run(60.0) == []
    house.speaker(1).beat = None
    assert house.run(20.0) == [("silent", 1, True)]


def test_256_ids_of_a_flood_and_senders_without_end_stay_bounded():
    house = House(1)
    for i in range(20000):
        house.watch.heard(i % 256, f"/node{i}", house.now, move=True)
        if i % 100 == 0:
            house.watch.linked(f"/bridge{i}", [], house.now)
    house.run(1.0)
    assert len(house.watch.statuses()) == 256
    assert len(house.watch.bridges()) <= 64
    assert all(len(t._senders) <= 8 for t in house.watch._tracked.values())


def test_garbage_in_links_harms_nobody():
    from rosbot_patrol.sensors.problems import Link

    house = House(1)
    for heard in (float("nan"), float("inf"), -1e9):
        house.watch.linked("", [Link(sensor_id=1, peer="", heard=heard, clock_offset=float("nan"))], house.now)
        house.run(2.0)
    assert [s.sensor_id for s in house.watch.statuses()] == [1]


@pytest.mark.parametrize("seed", range(8))
def test_whatever_happens_each_problem_begins_and_ends_in_turn(seed):
    rng = random.Random(seed)
    house = House(1, 2, 3, listed=bool(seed % 2), no_motion_after=40.0, stuck_after=20.0, unknown_calm=30.0)
    house.speakers.append(Speaker(rng.choice([1, 9]), "10.0.0.66:1", "/esp_client2"))
    for _ in range(40):
        s = rng.choice(house.speakers)
        s.beat = rng.choice([None, 0.5, 0.5, 4.0])
        s.move, s.clock = rng.random() < 0.3, rng.choice([None, 0.0, 1e6])
        s.peer = rng.choice([s.peer, f"10.0.0.{rng.randrange(9)}:{rng.randrange(9)}"])
        house.bridges = {b for b in ("/esp_client1", "/esp_client2") if rng.random() < 0.8}
        if rng.random() < 0.05:
            house.now += rng.choice([100.0, -100.0])
        house.run(rng.choice([0.25, 3.0, 12.0, 40.0]))
    active = set()
    for event in house.events:
        assert (event.problem.key in active) is not event.active
        (active.add if event.active else active.discard)(event.problem.key)
        assert event.lasted >= 0.0
        assert event.text
    assert active == set(house.watch.problems())
    for s in house.speakers[:3]:
        s.beat, s.move, s.clock, s.heard = 0.5, False, 0.0, house.now
    house.bridges = {"/esp_client1"}
    house.speakers.pop()
    house.run(1000.0)
    gone = {"bridge_gone//esp_client2", "silent/9"}  # who left for good
    assert set(house.wrong()) - gone <= {f"no_motion/{i}" for i in (1, 2, 3)}


def test_a_sensor_without_a_key_has_a_new_address():
    house = House(3)
    house.watch.recall_addresses({"3": "10.0.0.3"})
    assert not [each for each in house.run(20) if each[0] == "new_address"]
    house.speaker(3).peer = "10.0.0.66:5000"
    told = [each for each in house.run(20) if each[0] == "new_address"]
    assert told == [("new_address", 3, True)]
    (problem,) = [p for k, p in house.watch.problems().items() if k.kind_name == "new_address"]
    assert problem.what == "speaks from 10.0.0.66, and spoke from 10.0.0.3 before; it has no key"
    assert house.watch.addresses() == {"3": "10.0.0.66"}
    assert ("new_address", 3, False) in house.run(700)


def test_an_address_that_changed_over_a_restart_is_noticed_and_one_with_a_key_may_change():
    house = House(3)
    house.watch.recall_addresses({"3": "10.0.0.99"})
    assert ("new_address", 3, True) in house.run(10)
    keyed = House(4)
    keyed.watch.linked("/b", [Link(sensor_id=4, peer="10.0.0.4:1", proven=True)], keyed.now)
    keyed.watch.tick(keyed.now)
    keyed.watch.linked("/b", [Link(sensor_id=4, peer="10.0.0.5:1", proven=True)], keyed.now + 1.0)
    keyed.watch.tick(keyed.now + 1.0)
    assert keyed.watch.addresses() == {}
