from rosbot_patrol.images.stream import Stream, StreamWatch


def make_watch(**change):
    return StreamWatch(**{"timeout": 2.0, "frozen_timeout": 5.0} | change)


def test_waits_flows_stops_and_flows_again():
    watch = make_watch()
    assert watch.state(100.0) is Stream.WAITING
    watch.note(100.0, b"a")
    assert watch.state(101.9) is Stream.FLOWING
    assert watch.state(102.1) is Stream.STOPPED
    assert watch.silent_for(103.0) == 3.0
    watch.note(103.0, b"b")
    assert watch.state(103.1) is Stream.FLOWING


def test_the_same_picture_for_long_is_frozen():
    watch = make_watch()
    for i in range(70):
        watch.note(i * 0.1, b"same")
    assert watch.state(7.0) is Stream.FROZEN
    watch.note(7.1, b"other")
    assert watch.state(7.2) is Stream.FLOWING


def test_a_camera_that_comes_back_with_its_old_picture_is_not_frozen_at_once():
    watch = make_watch()
    watch.note(0.0, b"same")
    watch.note(30.0, b"same")
    assert watch.state(30.1) is Stream.FLOWING


def test_zero_means_never_frozen():
    watch = make_watch(frozen_timeout=0.0)
    for i in range(200):
        watch.note(i * 0.1, b"same")
    assert watch.state(20.0) is Stream.FLOWING


def test_rate():
    watch = make_watch()
    for i in range(100):
        watch.note(i * 0.1, i)
    assert abs(watch.rate - 10.0) < 0.5
