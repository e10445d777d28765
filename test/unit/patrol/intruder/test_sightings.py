import pytest

from rosbot_patrol.patrol.intruder.exclusions import Exclusions, KnownObject
from rosbot_patrol.patrol.intruder.sightings import Sightings, SightingsParams
from rosbot_patrol.patrol.records.inputs import Box, Frame, Measured


def box(label="person", probability=0.9, xmin=100, ymin=100, xmax=200, ymax=400):
    return Box(label=label, probability=probability, xmin=xmin, ymin=ymin, xmax=xmax, ymax=ymax)


def feed(watch, frames, now=None):
    found = []
    for frame in frames:
        found += watch.add(frame.stamp if now is None else now, frame)
    return found


def frames(*boxes, start=1.0, period=0.1):
    return [Frame(stamp=start + i * period, boxes=tuple(b)) for i, b in enumerate(boxes)]


@pytest.fixture
def watch():
    watch = Sightings(("person", "fire hydrant"))
    watch.start(0.0)
    return watch


def test_three_pictures_over_two_tenths_make_an_intruder(watch):
    found = feed(watch, frames([box(probability=0.7)], [box(probability=0.9)], [box(probability=0.6)]))
    assert len(found) == 1
    assert found[0].label == "person"
    assert found[0].probability == pytest.approx(0.7)
    assert found[0].stamp == pytest.approx(1.1)  # the surest picture is the one for the mail


def test_two_pictures_do_not(watch):
    assert feed(watch, frames([box()], [box()])) == []


def test_three_of_five_with_gaps(watch):
    assert len(feed(watch, frames([box()], [], [box()], [], [box()]))) == 1


def test_two_of_five_do_not(watch):
    assert feed(watch, frames([box()], [], [], [box()], [], [], [box()])) == []


def test_pictures_without_a_stamp_count_as_empty(watch):
    watch.add(1.0, Frame(stamp=1.0, boxes=(box(),)))
    for i in range(5):
        watch.add(1.1 + i / 10, Frame())
    assert feed(watch, frames([box()], [box()], start=2.0)) == []


def test_an_empty_picture_never_hides_a_later_stamp(watch):
    # darknet_ros says "nothing" with the time of now, and boxes with the earlier time of their picture
    watch.add(1.30, Frame())
    found = [watch.add(1.3 + i / 10, Frame(stamp=1.15 + i / 10, boxes=(box(),))) for i in range(3)]
    assert found[-1]


def test_the_same_picture_again_and_again_proves_nothing(watch):
    assert feed(watch, [Frame(stamp=1.0, boxes=(box(),))] * 50, now=1.0) == []


def test_pictures_from_before_the_mission_do_not_count():
    # the original mails when it is home again, from messages that waited (CONTRACTS A0, quirk 1)
    watch = Sightings(("person",))
    watch.start(5.0)
    assert feed(watch, frames([box()], [box()], [box()], start=4.0), now=5.5) == []


def test_old_pictures_do_not_count(watch):
    assert feed(watch, frames([box()], [box()], [box()], start=1.0), now=30.0) == []


def test_unsure_pictures_do_not(watch):
    assert feed(watch, frames(*[[box(probability=0.35)]] * 6)) == []


@pytest.mark.parametrize(
    "bad",
    [
        {"label": "chair"},
        {"ymin": 395},  # too low
        {"xmax": 100},  # no width
        {"xmin": 0, "xmax": 640, "ymin": 300, "ymax": 320},  # a stripe
        {"probability": 0.0},
        {"probability": 7.0},
    ],
)
def test_implausible_boxes_do_not(watch, bad):
    assert feed(watch, frames(*[[box(**bad)]] * 6)) == []


def test_fire_hydrants_alarm_by_default_and_classes_do_not_add_up(watch):
    assert feed(watch, frames([box()], [box(label="fire hydrant")], [box()], [box(label="fire hydrant")])) == []
    assert feed(watch, frames(*[[box(label="fire hydrant")]] * 3, start=3.0))[0].label == "fire hydrant"


def test_a_slow_detector_confirms_too(watch):
    assert len(feed(watch, frames([box()], [box()], [box()], period=1.5))) == 1


def test_a_candidate_is_something_seen_lately(watch):
    assert not watch.candidate(1.0)
    watch.add(1.0, Frame(stamp=0.9, boxes=(box(),)))
    assert watch.candidate(1.3)
    assert not watch.candidate(2.0)


def test_one_picture_is_enough_where_asked_for():
    watch = Sightings(("person",), SightingsParams(frames=1, window=1, span=0.0))
    assert len(feed(watch, frames([box()], start=1.0))) == 1


def test_a_burst_of_pictures_within_a_tenth_of_a_second_is_too_short(watch):
    assert feed(watch, frames(*[[box()]] * 4, period=0.02)) == []


def test_one_sure_picture_does_not_make_up_for_doubtful_ones(watch):
    assert feed(watch, frames(*[[box(probability=p)] for p in (0.5, 0.99, 0.5, 0.99, 0.5)])) == []


def at(x, y, **fields):
    defaults = {"error": 0.1, "away": 2.0, "top": 1.7, "height": 1.6, "width": 0.5}
    return Measured(x=x, y=y, **{**defaults, **fields})


def placed(x, y, probability=0.9, **fields):
    return Box(
        label="person", probability=probability, xmin=100, ymin=100, xmax=200, ymax=400, measured=at(x, y, **fields)
    )


def test_two_who_are_in_view_at_once_are_confirmed_each(watch):
    found = feed(watch, frames(*[[placed(1.0, 1.0), placed(4.0, 1.0, 0.8)]] * 3))
    assert [round(seen.measured.x) for seen in found] == [1, 4]
    assert [seen.boxes[0].measured.x for seen in found] == [1.0, 4.0]


def test_boxes_at_different_places_do_not_add_up(watch):
    assert feed(watch, frames([placed(1.0, 1.0)], [placed(5.0, 1.0)], [placed(1.0, 5.0)])) == []


def test_one_who_walks_is_one(watch):
    assert len(feed(watch, frames(*[[placed(1.0 + 0.15 * i, 1.0)] for i in range(3)]))) == 1


def test_a_box_whose_place_is_not_known_adds_to_any(watch):
    assert len(feed(watch, frames([box()], [placed(1.0, 1.0)], [box()]))) == 1


def test_the_surest_place_of_the_last_pictures_is_told(watch):
    found = feed(watch, frames([placed(1.3, 1.0, error=0.9)], [placed(1.0, 1.0, error=0.1)], [box()]))
    assert found[0].measured.x == 1.0


def test_a_place_of_the_whole_is_told_rather_than_one_of_a_part(watch):
    parts = (False, False, True)
    found = feed(watch, frames(*[[placed(1.0 + 0.2 * i, 1.0, is_cut_aside=part)] for i, part in enumerate(parts)]))
    assert found[0].measured.x == pytest.approx(1.2)


def test_of_places_about_as_sure_the_newest_is_told(watch):
    errors = (0.10, 0.11, 0.12)
    found = feed(watch, frames(*[[placed(1.0 + 0.2 * i, 1.0, error=e)] for i, e in enumerate(errors)]))
    assert found[0].measured.x == pytest.approx(1.4)


@pytest.mark.parametrize(("probability", "is_one"), [(0.75, False), (0.85, True)])
def test_what_the_side_of_the_picture_cuts_has_to_be_surer(watch, probability, is_one):
    # half a potted plant at the picture's edge came as a person of 0.71
    found = feed(watch, frames(*[[placed(1.0, 1.0, probability, is_cut_aside=True)]] * 5))
    assert bool(found) == is_one


def test_one_box_that_is_whole_lets_the_usual_score_do(watch):
    cut = [placed(1.0, 1.0, 0.75, is_cut_aside=True)]
    assert feed(watch, frames(cut, cut)) == []
    assert len(feed(watch, frames([placed(1.0, 1.0, 0.75)], start=1.2))) == 1


def test_a_score_for_what_is_cut_below_the_usual_one_changes_nothing():
    watch = Sightings(("person",), SightingsParams(min_score=0.7, cut_score=0.5))
    assert feed(watch, frames(*[[placed(1.0, 1.0, 0.65, is_cut_aside=True)]] * 5)) == []


@pytest.mark.parametrize(("probability", "is_one"), [(0.75, False), (0.85, True)])
def test_what_is_no_person_has_to_be_surer(watch, probability, is_one):
    # a waste bin behind the leg of a table, two rooms away, came as a hydrant of 0.66
    assert bool(feed(watch, frames(*[[box("fire hydrant", probability)]] * 5))) == is_one


def test_what_the_judge_refuses_counts_as_nothing_seen_and_is_told():
    watch = Sightings(("person",), exclusions=Exclusions(known=(KnownObject(x=1.0, y=1.0, name="the coat stand"),)))
    watch.start(0.0)
    assert feed(watch, frames(*[[placed(1.1, 1.0)]] * 4)) == []
    assert not watch.candidate(1.3)
    assert watch.refusals == {"it is the coat stand at (1.0, 1.0)": 4}


def test_a_picture_that_does_not_count_proves_nothing_but_is_worth_stopping_for(watch):
    for i in range(6):
        assert watch.add(1.0 + i / 10, Frame(stamp=1.0 + i / 10, boxes=(box(),), counts=False)) == ()
    assert watch.candidate(1.6)
    assert watch.lately(1.6) >= 2
    assert not watch.candidate(3.0)
