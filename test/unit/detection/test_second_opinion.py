import math

import numpy as np
import pytest

from rosbot_patrol.detection.detector import Detection
from rosbot_patrol.detection.second_opinion import DENIAL, SecondOpinion, overlap
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.images.encodings import Picture

PICTURE = Picture(np.zeros((100, 100, 3), np.uint8), "rgb8")
BOX, NEAR, FAR = (10, 10, 40, 90), (12, 10, 42, 90), (60, 10, 90, 90)


def person(probability, box=BOX, *, number=0):
    return Detection(number, "person", probability, *box)


class Told:
    """A detector that says what it was told to; how often it was asked."""

    runtime = "told"

    def __init__(self, *pictures, names=("person",)):
        self.names, self.pictures, self.asked = names, list(pictures), 0

    def detect(self, picture):
        self.asked += 1
        return self.pictures.pop(0) if self.pictures else []


def ask(first, second, **change):
    detector = SecondOpinion(
        Told(*([one] for one in first), names=("dog", "person")),
        Told(second),
        **{"threshold": 0.4, "second_threshold": 0.5} | change,
    )
    return detector.detect(PICTURE)


def log_odds(probability):
    return math.log(probability / (1 - probability))


def test_what_both_see_gets_more_probable_and_the_place_of_the_second():
    (both,) = ask([person(0.6, number=1)], [person(0.7, NEAR)])
    assert log_odds(both.probability) == pytest.approx(log_odds(0.6) + log_odds(0.7) - log_odds(0.2))
    assert (both.class_id, both.name) == (1, "person")  # the number of the first's classes
    assert (both.xmin, both.xmax) == NEAR[::2]


def test_a_weak_box_is_published_where_the_second_agrees():
    assert ask([person(0.25)], []) == []
    assert ask([person(0.25)], [person(0.3)]) == []
    assert len(ask([person(0.25)], [person(0.6)])) == 1
    assert len(ask([person(0.39)], [person(0.25)])) == 1


def test_a_weak_second_takes_away_but_measures_the_place():
    (both,) = ask([person(0.45, number=1)], [person(0.12, NEAR)])
    assert both.probability < 0.4
    assert (both.xmin, both.xmax) == NEAR[::2]
    assert ask([person(0.39)], [person(0.12)]) == []


def test_what_the_second_denies_loses_but_stays():
    (denied,) = ask([person(0.45)], [])
    assert log_odds(denied.probability) == pytest.approx(log_odds(0.45) - DENIAL)
    assert ask([person(0.39)], []) == []


def test_what_only_the_second_sees_has_its_own_probability():
    assert ask([person(0.25, number=1)], [person(0.8, FAR)]) == [person(0.8, FAR, number=1)]
    assert ask([person(0.25)], [person(0.49, FAR)]) == []
    assert len(ask([person(0.9)], [person(0.8, FAR)])) == 2


def test_one_box_agrees_with_one():
    found = ask([person(0.9)], [person(0.9, NEAR), person(0.8)])
    assert len(found) == 2
    assert [one.probability for one in found] == sorted((one.probability for one in found), reverse=True)


def test_bounds_do_not_overflow():
    (sure,) = ask([person(1.0)], [person(1.0)])
    assert 0.999 < sure.probability <= 1.0


def test_it_is_asked_where_the_first_is_unsure_or_sure_for_the_first_time():
    empty, unsure, sure = [], [person(0.3)], [person(0.9)]
    for pictures, asked in (
        ([empty, empty], 0),
        ([unsure, unsure, unsure], 3),
        ([sure, sure, sure], 1),
        ([sure, empty, sure], 2),
        ([sure, unsure, sure], 3),
    ):
        second = Told()
        detector = SecondOpinion(Told(*pictures), second, threshold=0.4, second_threshold=0.5)
        for _ in pictures:
            detector.detect(PICTURE)
        assert second.asked == asked, pictures


def test_pictures_that_do_not_follow_each_other():
    second = Told()
    detector = SecondOpinion(Told([person(0.9)], [person(0.9)]), second, threshold=0.4, second_threshold=0.5)
    detector.detect(PICTURE)
    detector.forget()
    detector.detect(PICTURE)
    assert second.asked == 2


def test_sure_for_longer_the_first_decides_alone():
    detector = SecondOpinion(
        Told([person(0.9)], [person(0.8), person(0.3, FAR)]), Told(), threshold=0.4, second_threshold=0.5
    )
    detector.detect(PICTURE)
    assert detector.detect(PICTURE) == [person(0.8)]


def test_other_classes_are_the_firsts():
    dog, shadow = Detection(0, "dog", 0.7, *FAR), Detection(0, "dog", 0.3, *BOX)
    first = Told([shadow, dog, person(0.3, number=1)], names=("dog", "person"))
    second = Told([Detection(1, "cat", 0.9, *FAR), person(0.9)], names=("person", "cat"))
    detector = SecondOpinion(first, second, threshold=0.4, second_threshold=0.5)
    found = detector.detect(PICTURE)
    assert [(one.class_id, one.name) for one in found] == [(0, "dog"), (1, "person")]
    assert (detector.names, detector.runtime) == (("dog", "person"), "told; second opinion: told")


def test_a_network_without_people():
    with pytest.raises(DetectorError, match="the network does not know the class 'person'"):
        SecondOpinion(Told(), Told(names=("dog",)), threshold=0.4, second_threshold=0.5)


def test_overlap():
    assert overlap(person(0.5), person(0.5)) == 1.0
    assert overlap(person(0.5), person(0.5, FAR)) == 0.0
    assert overlap(person(0.5, (0, 0, 10, 10)), person(0.5, (5, 0, 15, 10))) == pytest.approx(1 / 3)
