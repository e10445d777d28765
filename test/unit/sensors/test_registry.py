from rosbot_patrol.sensors.registry import Change, MotionSensors


def changes(events):
    return [(event.change, event.sensor_id) for event in events]


def test_new_silent_and_back_are_told_once():
    sensors = MotionSensors(timeout=3.0)
    assert changes(sensors.heard(2, "10.0.0.2", 0.0)) == [(Change.NEW, 2)]
    assert sensors.heard(2, "10.0.0.2", 0.5) == []
    assert sensors.tick(3.0) == []
    (event,) = sensors.tick(4.0)
    assert str(event) == "motion sensor 2 (10.0.0.2) has not been heard of for 4 s"
    assert sensors.tick(5.0) == []
    (event,) = sensors.heard(2, "10.0.0.2", 9.0)
    assert str(event) == "motion sensor 2 (10.0.0.2) is back after 8 s"


def test_each_sensor_by_itself():
    sensors = MotionSensors(timeout=3.0)
    sensors.heard(1, "a", 0.0)
    sensors.heard(7, "b", 2.0, move=True)
    assert changes(sensors.tick(4.0)) == [(Change.SILENT, 1)]
    first, last = sensors.statuses(4.0)
    assert (first.silent, last.silent) == (True, False)
    assert (last.sensor_id, last.messages, last.triggers, last.seconds) == (7, 1, 1, 2.0)


def test_clock_that_goes_back_starts_anew():
    sensors = MotionSensors(timeout=3.0)
    sensors.heard(1, "a", 100.0)
    assert sensors.tick(1.0) == []
    assert changes(sensors.tick(5.0)) == [(Change.SILENT, 1)]
