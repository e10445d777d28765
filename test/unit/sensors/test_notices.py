import pytest
from sensor_house import House

from rosbot_patrol.graph.judge import Fault, Finding
from rosbot_patrol.sensors.looks import Looks
from rosbot_patrol.sensors.notices import Notices
from rosbot_patrol.sensors.problems import Kind
from rosbot_patrol.sensors.sensor_file import SensorSpec
from rosbot_patrol.sensors.settings import LookTimes, NoticeTimes

WALL = 1_790_000_000.0


class Owner:
    """Lets a house run, and collects the notices."""

    def __init__(self, house, memory=None, **times):
        self.house = house
        self.guarded = None  # rooms, None for all
        self.notices = Notices(
            NoticeTimes(**times), house.now, memory, is_guarded=lambda r: self.guarded is None or r in self.guarded
        )
        self.got = []

    def run(self, seconds):
        before = len(self.got)
        for _ in range(round(seconds)):
            self.house.run(1.0)
            watch, now = self.house.watch, self.house.now
            notice = self.notices.update(watch, watch.statuses(), now, WALL + now)
            self.got += [notice] if notice else []
        return self.got[before:]

    def silence(self, *ids):
        for i in ids:
            self.house.speaker(i).beat = None

    def wake(self, *ids):
        for i in ids:
            self.house.speaker(i).beat = 0.5


def kinds(notice):
    return [item.kind for item in notice.items]


def test_told_once_and_again_when_it_is_well():
    owner = Owner(House(specs=[SensorSpec(id=3, room=5, name="hall door")]))
    owner.house.speakers = House(3).speakers
    assert owner.run(120) == []
    owner.silence(3)
    assert owner.run(69) == []
    (notice,) = owner.run(4000)
    assert notice.subject == 'rosbot patrol: sensor 3 "hall door" in room 5 (place 5) is silent'
    assert notice.text.startswith(
        '- Sensor 3 "hall door" in room 5 (place 5) is silent: nothing was heard for more than'
    )
    assert ", 70 s ago.\n" in notice.text
    assert "What to do: see that it has power and Wi-Fi" in notice.text
    assert notice.text.endswith("\n\n0 of 1 motion sensor is well.\n")
    owner.wake(3)
    assert owner.run(60) == []
    (notice,) = owner.run(4000)
    assert notice.subject == 'rosbot patrol: sensor 3 "hall door" in room 5 (place 5) is well again'
    assert "is well again: it was silent, from" in notice.text
    assert "for 69 min" in notice.text


def test_a_blip_of_the_wifi_is_no_mail():
    owner = Owner(House(1, 2, 3, 4, 5))
    owner.run(60)
    owner.silence(1, 2, 3, 4, 5)
    owner.run(45)
    owner.wake(1, 2, 3, 4, 5)
    assert owner.run(3600) == []


def test_a_dozen_at_once_is_one_notice_that_lists_them():
    owner = Owner(House(*range(1, 15)))
    owner.run(60)
    for i in range(1, 13):  # as their time-outs come
        owner.silence(i)
        owner.house.run(2.0)
    (notice,) = owner.run(250)
    assert notice.subject == "rosbot patrol: 12 motion sensors are silent"
    assert notice.text.count("\n- ") + 1 == 12
    assert "look at the Wi-Fi" in notice.text
    assert "2 of 14 motion sensors are well." in notice.text
    owner.wake(*range(1, 13))
    (notice,) = owner.run(1000)
    assert notice.subject == "rosbot patrol: 12 motion sensors are well again"


def test_a_flood_of_unknown_ids_is_one_bounded_notice():
    owner = Owner(House(1))
    for i in range(2, 256):
        owner.house.watch.heard(i, "/x", owner.house.now, move=True)
    (notice,) = owner.run(80)
    assert notice.subject == "rosbot patrol: 254 things are wrong with the motion sensors"
    assert len(notice.text.splitlines()) < 30
    assert "- and 234 more" in notice.text


def test_a_sensor_that_comes_and_goes_is_one_notice():
    owner = Owner(House(1), notice_interval=0.0)
    owner.run(60)
    for _ in range(20):
        owner.silence(1)
        owner.run(40)
        owner.wake(1)
        owner.run(20)
    assert [kinds(n) for n in owner.got] == [[Kind.FLAPPING]]
    assert [kinds(n) for n in owner.run(2000)] == [[None]]
    owner.silence(1)
    assert [kinds(n) for n in owner.run(100)] == [[Kind.SILENT]]


def test_a_flapping_sensor_that_then_stays_away_is_not_called_well():
    owner = Owner(House(1), notice_interval=0.0)
    owner.run(60)
    for _ in range(10):
        owner.silence(1)
        owner.run(5)
        owner.wake(1)
        owner.run(15)
    owner.silence(1)
    owner.run(2000)
    assert [kinds(n) for n in owner.got] == [[Kind.FLAPPING], [Kind.SILENT]]
    owner.wake(1)
    (notice,) = owner.run(1000)
    assert "it came and went, it was silent" in notice.text


def test_a_bridge_that_has_gone_speaks_for_its_sensors():
    owner = Owner(House(1, 2), notice_interval=0.0)
    owner.run(60)
    owner.house.bridges.clear()
    (notice,) = owner.run(600)
    assert notice.subject == "rosbot patrol: bridge /esp_client1 has gone"
    assert "and with it of sensor 1 in room 1 (place 1), sensor 2 in room 2 (place 2)" in notice.text
    owner.house.bridges.add("/esp_client1")
    owner.silence(2)  # and this one does not come back with it
    first, second = owner.run(600)
    assert {n.subject for n in (first, second)} == {
        "rosbot patrol: bridge /esp_client1 is well again",
        "rosbot patrol: sensor 2 in room 2 (place 2) is silent",
    }


def test_notices_keep_their_distance_and_lose_nothing():
    owner = Owner(House(*range(1, 11)), notice_interval=300.0)
    owner.run(60)
    for i in range(1, 11):
        owner.silence(i)
        owner.run(100)
    owner.run(600)
    assert len(owner.got) <= 6
    assert sum(len(n.items) for n in owner.got) == 10


def test_what_was_told_outlives_the_program():
    house = House(1, 2)
    owner = Owner(house)
    owner.run(60)
    owner.silence(2)
    assert len(owner.run(100)) == 1
    memory = owner.notices.snapshot()
    again = House(1, 2)
    again.speaker(2).beat = None
    owner = Owner(again, memory)
    assert owner.run(2000) == []
    owner.wake(2)
    (notice,) = owner.run(400)
    assert notice.subject.endswith("sensor 2 in room 2 (place 2) is well again")
    ids = {notice.id, f"x{memory['count']}"}
    assert len(ids) == 2


@pytest.mark.parametrize(
    "memory", [{"told": 5}, {"count": 1, "told": [["burnt", 1, "", 0.0]]}, {"count": "x", "told": []}]
)
def test_a_memory_that_is_invalid_is_said_and_forgotten(memory, caplog):
    Notices(NoticeTimes(), 0.0, memory)
    assert "about sensors are invalid" in caplog.text


def test_the_robot_looks_once_for_each_silence():
    house = House(1, 2, 3)
    looks = Looks(LookTimes(patrol_silent_sensors=True))
    house.speaker(3).beat = None

    def run(seconds):
        wishes = []
        for _ in range(seconds):
            house.run(1.0)
            wishes += looks.update(house.watch, house.watch.statuses(), house.now)
        return [(w.sensor_id, w.room) for w in wishes]

    assert run(120) == []  # who was never heard is no change
    house.speaker(2).beat = None
    assert run(28) == []
    assert run(900) == [(2, 2)]
    house.speaker(2).beat = 0.5
    run(60)
    house.speaker(2).beat = None
    assert run(600) == []  # so soon after the last look
    house.speaker(2).beat = 0.5
    run(2500)
    house.speaker(2).beat = None
    assert run(60) == [(2, 2)]
    house.bridges.clear()
    assert run(300) == []
    assert Looks(LookTimes()).update(house.watch, house.watch.statuses(), house.now) == []


def test_a_patrol_that_hangs_is_told_first_and_by_whom_it_was_heard():
    owner = Owner(House(1, 2))
    owner.house.watch.patrol_heard("/patrolling_node", owner.house.now)
    owner.silence(1, 2)
    (notice,) = owner.run(100.0)
    assert notice.subject == "rosbot patrol: the patrol (patrolling_node) has gone, or hangs, and 2 more are not well"
    assert notice.text.startswith("- The patrol (patrolling_node) has gone, or hangs: nothing is heard of it")
    memory = owner.notices.snapshot()
    again = Owner(House(1, 2), memory)  # the watch was restarted: what was told is not told again
    assert not any("The patrol" in notice.text for notice in again.run(400.0))
    for _ in range(100):
        again.house.watch.patrol_heard("/patrolling_node", again.house.now)
        again.run(1.0)
    assert "the patrol (patrolling_node) is well again" in again.got[-1].text.lower()


def people_at_home(owner, *ids):
    for i in ids:
        owner.house.speaker(i).move = True  # reports its level


def test_people_at_home_are_no_notice_and_one_that_stays_stuck_is_told_when_they_have_left():
    owner = Owner(House(1, 2))
    owner.guarded = frozenset()  # disarmed
    people_at_home(owner, 1, 2)
    assert owner.run(5000) == []
    assert ("stuck_on", 1, True) in [*map(str_event, owner.house.events)]  # the state is there all the same
    owner.guarded = None
    owner.house.speaker(1).move = False  # the last one goes as the exit delay ends; 2 is stuck
    assert owner.run(149) == []
    (notice,) = owner.run(600)
    assert kinds(notice) == [Kind.STUCK_ON]
    assert notice.subject == "rosbot patrol: sensor 2 in room 2 (place 2) reports motion without an end"


def str_event(event):
    return event.problem.key.kind_name, event.problem.key.sensor_id, event.active


def test_only_guarded_rooms_tell_of_motion_and_all_tell_of_silence():
    owner = Owner(House(1, 2, 3))
    owner.guarded = frozenset({2})
    people_at_home(owner, 1, 2)
    owner.silence(3)
    owner.run(3000)
    assert sorted(map(str, (kind for notice in owner.got for kind in kinds(notice)))) == sorted(
        map(str, (Kind.SILENT, Kind.STUCK_ON))
    )
    assert not any("sensor 1 " in notice.text for notice in owner.got)


def test_a_guard_that_comes_and_goes_begins_anew_each_time():
    owner = Owner(House(1))
    people_at_home(owner, 1)
    owner.guarded = frozenset()
    owner.run(1000)
    for _ in range(5):
        owner.guarded = None
        assert owner.run(140) == []
        owner.guarded = frozenset()
        assert owner.run(10) == []
    owner.guarded = None
    assert len(owner.run(200)) == 1


def test_what_was_told_while_armed_is_told_to_be_over_and_no_more_while_disarmed():
    owner = Owner(House(1))
    people_at_home(owner, 1)
    assert len(owner.run(900)) == 1
    owner.guarded = frozenset()
    assert owner.run(3000) == []
    owner.house.speaker(1).move = False
    (notice,) = owner.run(600)
    assert "is well again" in notice.subject
    people_at_home(owner, 1)
    assert owner.run(3000) == []


def test_very_long_without_motion_is_told_where_it_is_guarded_only():
    owner = Owner(House(1, 2, no_motion_after=500.0))
    owner.guarded = frozenset({2})
    owner.run(3000)
    assert [notice.subject for notice in owner.got] == [
        "rosbot patrol: sensor 2 in room 2 (place 2) has seen no motion for very long"
    ]


def test_a_second_driver_is_told_at_once_and_again_when_it_has_gone():
    owner = Owner(House(1))
    owner.run(5)
    thief = Finding(fault=Fault.SECOND_DRIVER, subject="topic /cmd_vel", what="has 2 publishers: /thief, /twist_mux")
    owner.house.watch.graph_seen([thief])
    (notice,) = owner.run(6)
    assert notice.subject == "rosbot patrol: topic /cmd_vel has a second publisher"
    assert "- Topic /cmd_vel has 2 publishers: /thief, /twist_mux. Since" in notice.text
    assert "scripts/secure" in notice.text
    owner.house.watch.graph_seen([])
    (notice,) = owner.run(1000)
    assert notice.subject == "rosbot patrol: topic /cmd_vel is well again"


def test_a_link_of_a_dead_bridge_is_the_bridges_problem():
    owner = Owner(House(1))
    owner.run(30)
    owner.house.bridges.clear()
    gone = Finding(fault=Fault.LINK_GONE, subject="the bridge of the motion sensors", what="has gone")
    owner.house.run(20)
    owner.house.watch.graph_seen([gone])
    assert [kinds(n) for n in owner.run(300)] == [[Kind.BRIDGE_GONE]]


def test_several_of_the_graph_are_one_notice():
    owner = Owner(House(1))
    found = [
        Finding(fault=Fault.STRANGE_NODE, subject=f"node /n{i}", what="runs on 10.0.0.9, a machine that it is not")
        for i in range(3)
    ]
    owner.house.watch.graph_seen(found)
    (notice,) = owner.run(30)
    assert notice.subject == "rosbot patrol: 3 things are wrong with the guard's network"
    assert notice.text.count("What to do") == 1
