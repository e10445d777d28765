import cv2
import numpy as np
import pytest

from rosbot_patrol.detection.hog import NAMES, HogDetector
from rosbot_patrol.errors import ImageError
from rosbot_patrol.images.encodings import Picture


def draw_person(canvas, left, top, height):
    """Somebody who stands, dark before a light wall: head, trunk, arms, legs; `left` is the middle of the trunk."""
    unit = height / 8.0

    def limb(x0, y0, x1, y1, thick):
        ends = [(round(left + x * unit), round(top + y * unit)) for x, y in ((x0, y0), (x1, y1))]
        cv2.line(canvas, *ends, (40, 40, 50), max(round(thick * unit), 1), cv2.LINE_AA)

    cv2.circle(canvas, (round(left), round(top + 0.55 * unit)), round(0.5 * unit), (70, 80, 120), -1, cv2.LINE_AA)
    limb(0, 1.7, 0, 4.0, 1.6)
    limb(-0.95, 1.7, -1.1, 4.2, 0.5)
    limb(0.95, 1.7, 1.1, 4.2, 0.5)
    limb(-0.4, 4.2, -0.6, 7.8, 0.75)
    limb(0.4, 4.2, 0.6, 7.8, 0.75)


def make_room(*people, width=640, height=480):
    canvas = np.full((height, width, 3), 190, dtype=np.uint8)
    canvas[round(height * 0.7) :] = 120
    for person in people:
        draw_person(canvas, *person)
    return Picture(canvas, "bgr8")


@pytest.mark.parametrize("size", [150, 240, 330])
def test_somebody_who_stands_is_found_where_he_stands(size):
    left, top = 400, 400 - size
    found = HogDetector().detect(make_room((left, top, size)))
    assert [(one.class_id, one.name) for one in found] == [(0, "person")]
    one = found[0]
    assert abs((one.xmin + one.xmax) / 2 - left) < 0.1 * size
    assert abs((one.ymin + one.ymax) / 2 - (top + size / 2)) < 0.12 * size
    assert one.ymax - one.ymin == pytest.approx(size, rel=0.25)
    assert 0.7 < one.probability < 1.0


def test_two_people_and_an_empty_room():
    detector = HogDetector()
    assert len(detector.detect(make_room((150, 180, 220), (480, 160, 240)))) == 2
    assert detector.detect(make_room()) == []
    assert detector.names == NAMES
    assert "HOG" in detector.runtime


def test_large_pictures_are_shrunk_and_boxes_are_not():
    small = HogDetector().detect(make_room((400, 150, 250)))[0]
    large = HogDetector().detect(make_room((1200, 450, 750), width=1920, height=1440))[0]
    assert large.xmin == pytest.approx(3 * small.xmin, abs=30)
    assert large.ymax == pytest.approx(3 * small.ymax, abs=30)


def test_threshold():
    picture = make_room((400, 150, 250))
    sure = HogDetector().detect(picture)[0].probability
    assert HogDetector(threshold=sure + 0.001).detect(picture) == []


@pytest.mark.parametrize("size", [(1, 1), (63, 400), (400, 127), (64, 128), (3000, 70)])
def test_pictures_of_odd_sizes(size):
    HogDetector().detect(make_room(width=size[0], height=size[1]))


def test_depth_is_refused():
    with pytest.raises(ImageError, match="32FC1 has no colours"):
        HogDetector().detect(Picture(np.zeros((300, 300, 1), np.float32), "32FC1"))
