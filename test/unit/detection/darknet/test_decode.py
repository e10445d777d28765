import numpy as np
import pytest

from rosbot_patrol.detection.darknet.decode import (
    Candidates,
    decode_head,
    iou,
    suppress_by_class,
    suppress_by_objectness,
)
from rosbot_patrol.detection.darknet.layers import Region, Yolo
from rosbot_patrol.detection.darknet.letterbox import Letterbox

ANCHORS = ((1.0, 2.0), (3.0, 4.0))


def make_region(**change):
    shape = (14, 2, 4)
    fields = {"index": 1, "line": 1, "in_shape": shape, "out_shape": shape, "anchors": ANCHORS, "classes": 2}
    return Region(**fields | {"softmax": True, "background": False} | change)


def make_yolo(**change):
    shape = (14, 2, 4)
    fields = {"index": 1, "line": 1, "in_shape": shape, "out_shape": shape, "anchors": ANCHORS, "classes": 2}
    return Yolo(**fields | {"scale_x_y": 1.0, "new_coords": False} | change)


def make_values(*, anchor=0, row=0, column=0, values):
    """A head where nothing is seen but in one place."""
    grid = np.full((2, 7, 2, 4), -20.0, dtype=np.float32)
    grid[anchor, :, row, column] = values
    return grid.reshape(14, 2, 4)


def logit(p):
    return np.log(p / (1 - p))


def test_region_by_hand():
    values = make_values(anchor=1, row=1, column=2, values=[0.0, 0.0, np.log(2), 0.0, logit(0.8), np.log(3), 0.0])
    found = decode_head(make_region(), values, (128, 64), 0.3)
    np.testing.assert_allclose(found.boxes, [[2.5 / 4, 1.5 / 2, 2 * 3 / 4, 4 / 2]], rtol=1e-6)
    assert found.objectness[0] == pytest.approx(0.8, abs=1e-6)
    np.testing.assert_allclose(found.probabilities, [[0.6, 0.0]], atol=1e-6)  # 0.8 x 3/4; 0.8 x 1/4 is below 0.3


def test_yolo_by_hand():
    values = make_values(anchor=0, row=0, column=3, values=[logit(0.25), 0.0, 0.0, np.log(8), 20.0, logit(0.9), 0.0])
    found = decode_head(make_yolo(), values, (128, 64), 0.3)
    np.testing.assert_allclose(found.boxes, [[3.25 / 4, 0.5 / 2, 1 / 128, 16 / 64]], rtol=1e-5)
    np.testing.assert_allclose(found.probabilities, [[0.9, 0.5]], rtol=1e-5)


def test_yolo_v4_stretches_the_cell():
    values = make_values(values=[logit(0.9), 0.0, 0.0, 0.0, 20.0, 20.0, 20.0])
    found = decode_head(make_yolo(scale_x_y=1.2), values, (128, 64), 0.3)
    np.testing.assert_allclose(found.boxes[0, :2], [(0.9 * 1.2 - 0.1) / 4, 0.5 / 2], rtol=1e-5)


def test_new_coords_square_the_size():
    values = np.zeros((2, 7, 2, 4), dtype=np.float32)
    values[0, :, 0, 0] = [0.5, 0.5, 0.5, 1.0, 0.9, 0.8, 0.0]
    found = decode_head(make_yolo(new_coords=True), values.reshape(14, 2, 4), (128, 64), 0.3)
    np.testing.assert_allclose(found.boxes, [[0.5 / 4, 0.5 / 2, 1 / 128, 4 * 2 / 64]], rtol=1e-5)
    np.testing.assert_allclose(found.probabilities, [[0.72, 0.0]], rtol=1e-5)


def test_objectness_at_the_threshold_does_not_count():
    values = make_values(values=[0.0, 0.0, 0.0, 0.0, 0.0, 9.0, 0.0])
    assert len(decode_head(make_region(), values, (128, 64), 0.5)) == 0
    assert len(decode_head(make_region(), values, (128, 64), 0.499)) == 1


def test_a_background_class_stands_for_objectness():
    values = make_values(values=[0.0, 0.0, 0.0, 0.0, -9.0, 9.0, 0.0])
    found = decode_head(make_region(background=True), values, (128, 64), 0.9)
    assert found.objectness.tolist() == [1.0] * 16
    assert (found.probabilities > 0).sum() == 1


def test_values_beyond_all_bounds_do_not_upset_it():
    values = make_values(values=[0.0, 0.0, 1000.0, 1000.0, 1000.0, 1000.0, 0.0])
    found = suppress_by_objectness(decode_head(make_region(), values, (128, 64), 0.3), 0.4)
    assert len(found) == 1


def make_candidates(boxes, objectness, probabilities):
    return Candidates(np.array(boxes, float), np.array(objectness, float), np.array(probabilities, float))


def test_suppression_by_objectness_asks_for_no_class():
    found = make_candidates(
        [[0.5, 0.5, 0.2, 0.2], [0.5, 0.5, 0.2, 0.19], [0.9, 0.5, 0.1, 0.1]],
        [0.6, 0.9, 0.5],
        [[0.6, 0.0], [0.0, 0.4], [0.5, 0.0]],
    )
    kept = suppress_by_objectness(found, 0.4)
    assert kept.objectness.tolist() == [0.9, 0.5]
    assert kept.probabilities.tolist() == [[0.0, 0.4], [0.5, 0.0]]


def test_a_suppressed_box_suppresses_nothing():
    boxes = [[0.3, 0.5, 0.2, 0.2], [0.37, 0.5, 0.2, 0.2], [0.44, 0.5, 0.2, 0.2]]
    kept = suppress_by_objectness(make_candidates(boxes, [0.9, 0.8, 0.7], [[0.5]] * 3), 0.4)
    assert kept.objectness.tolist() == [0.9, 0.7]


def test_suppression_by_class_keeps_other_classes():
    found = make_candidates([[0.5, 0.5, 0.2, 0.2]] * 2, [0.6, 0.9], [[0.6, 0.3], [0.5, 0.4]])
    assert suppress_by_class(found, 0.4).probabilities.tolist() == [[0.6, 0.0], [0.0, 0.4]]


def test_iou():
    box = np.array([0.5, 0.5, 0.2, 0.2])
    others = np.array([[0.5, 0.5, 0.2, 0.2], [0.6, 0.5, 0.2, 0.2], [0.9, 0.9, 0.1, 0.1], [0.5, 0.5, 0.0, 0.0]])
    np.testing.assert_allclose(iou(box, others), [1.0, 1 / 3, 0.0, 0.0], atol=1e-9)


def test_letterbox_of_a_wide_picture():
    place = Letterbox(640, 480, 416, 416)
    assert place.fitted == (416, 312)
    assert place.margins == (0, 52, 0, 52)
    boxes = place.to_picture(np.array([[0.5, 52 / 416, 0.5, 0.75]]))
    np.testing.assert_allclose(boxes, [[0.5, 0.0, 0.5, 1.0]], atol=1e-12)


@pytest.mark.parametrize("size", [(1, 1), (1, 900), (900, 1), (416, 416)])
def test_letterbox_of_odd_pictures(size):
    place = Letterbox(*size, 416, 416)
    assert min(place.fitted) >= 1
    drawn = place.draw(np.full((size[1], size[0], 3), 255, dtype=np.uint8))
    assert drawn.shape == (3, 416, 416)
    assert np.isfinite(drawn).all()


def test_resizing_keeps_the_corners():
    picture = np.arange(12, dtype=np.uint8).reshape(3, 4, 1) * 20
    drawn = Letterbox(4, 3, 8, 6).draw(picture)[0] * 255
    assert drawn[0, 0] == pytest.approx(0.0)
    assert drawn[0, 7] == pytest.approx(60.0, abs=1e-3)
    assert drawn[0, 1] == pytest.approx(20 * 3 / 7, abs=1e-3)
    assert drawn[2, 0] == pytest.approx(80 * 2 * 2 / 5, abs=1e-3)


def test_row_above_the_last_by_rounding_is_black_as_in_darknet():
    # 479 / 119 in single precision, times 119, is just under 479
    assert Letterbox(640, 480, 160, 128).row_gains[-1] == pytest.approx(0.0, abs=1e-4)
    assert Letterbox(128, 128, 128, 128).row_gains.tolist() == [1.0] * 128
