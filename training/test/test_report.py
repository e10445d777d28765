from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from training.judging import report, scoring
from training.learning.anchors import find_anchors, write_anchors
from training.learning.dataset import OVERLAY, Pictures, asked, batch_of, sureness

CFG = Path(__file__).parents[2] / "models" / "house.cfg"


def row(
    picture=0,
    kind=0,
    box=(0.2, 0.1, 0.4, 0.9),
    distance=3.0,
    whole=1.0,
    part=1.0,
    pixels=9000,
    light=100.0,
    contrast=50.0,
):
    return [picture, kind, *box, distance, whole, part, pixels, light, 0, contrast]


@pytest.fixture
def pictures(tmp_path: Path) -> Pictures:
    """Two pictures: a person on the left of the first, nothing in the second."""
    shots = np.zeros((2, 288, 384, 3), np.uint8)
    shots[0, 29:259, 77:153] = (10, 200, 30)
    np.save(tmp_path / "set-0000.npy", shots)
    np.savez(tmp_path / "set-0000.npz", boxes=np.array([row()], np.float32))
    return Pictures.open(tmp_path, "set")


def test_a_batch_holds_pictures_and_their_boxes(pictures: Pictures) -> None:
    images, rows = batch_of(pictures, pictures.index(), None)
    assert images.shape == (2, 288, 384, 3)
    assert rows.tolist() == [[0, 0, *map(pytest.approx, (115.2, 144, 76.8, 230.4)), 1]]
    assert (images[0, 29:259, 77:153] == (10, 200, 30)).all()


def test_a_mirrored_picture_has_mirrored_boxes(pictures: Pictures) -> None:
    seen = set()
    for seed in range(12):
        if np.random.default_rng(seed).random() < OVERLAY:
            continue  # this one is covered with patterns
        images, rows = batch_of(pictures, pictures.index()[:1], np.random.default_rng(seed))
        x, y = int(rows[0, 2]), int(rows[0, 3])
        seen.add(x)
        assert images[0, y, x].max() > 100
        assert images[0, y, 384 - x].max() < 30
    assert seen == {115, 268}


def test_hardly_seen_people_are_not_asked_for() -> None:
    rows = np.array([row(), row(part=0.1), row(pixels=50), row(light=2.0), row(box=(0.5, 0.5, 0.51, 0.52))])
    rows = np.vstack([rows, row(contrast=3.0)])
    assert asked(rows).tolist() == [True, False, False, False, False, False]


def test_who_hides_is_to_be_less_sure_and_a_hydrant_is_not() -> None:
    rows = np.array([row(), row(part=0.5, whole=0.5), row(part=0.3, whole=0.3), row(part=0.9, whole=0.35)])
    rows = np.vstack([rows, row(part=0.9, whole=0.2), row(kind=1, part=0.3, whole=0.3)])
    assert sureness(rows) == pytest.approx([1.0, 0.825, 0.65, 0.825, 0.65, 1.0])


def test_a_folder_without_pictures_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"holds no pictures named train"):
        Pictures.open(tmp_path, "train")


def test_anchors_are_the_usual_sizes_and_go_into_the_cfg(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    rows = []
    for w, h in ((0.1, 0.2), (0.3, 0.8)):
        for _ in range(50):
            rows.append(row(box=(0.1, 0.1, 0.1 + w * rng.uniform(0.95, 1.05), 0.1 + h * rng.uniform(0.95, 1.05))))
    anchors = find_anchors(Pictures([], [[np.array(rows)]]), 2, 1)
    assert np.allclose(anchors, [[38.4, 57.6], [115.2, 230.4]], rtol=0.06)
    cfg = tmp_path / "a.cfg"
    cfg.write_text("[yolo]\nanchors = 1,1, 2,2\nmask=0\n[yolo]\nanchors=1,1\n")
    write_anchors(cfg, np.array([[32.4, 48.0], [96.0, 192.0]]))
    assert cfg.read_text().count("anchors=32,48, 96,192\n") == 2


def forward_of(*boxes):
    """A network that answers with given boxes (x, y, w, h shares of the input, kind) in the first picture."""
    spec = report.read_cfg(str(CFG))

    def forward(images: np.ndarray) -> list[np.ndarray]:
        values = [np.full((len(images), len(h.anchors) * 7, *h.in_shape[1:]), -12.0, np.float32) for h in spec.heads]
        head, grid = spec.heads[0], values[0].reshape(len(images), 3, 7, *spec.heads[0].in_shape[1:])
        rows, columns = head.in_shape[1:]
        for x, y, w, h, kind in boxes:
            c, r = int(x * columns), int(y * rows)
            offset = np.clip([x * columns - c, y * rows - r], 1e-4, 1 - 1e-4)
            grid[0, 0, :2, r, c] = np.log(offset / (1 - offset))
            grid[0, 0, 2:4, r, c] = np.log(np.array([w * spec.width, h * spec.height]) / head.anchors[0])
            grid[0, 0, 4, r, c] = 3.0
            grid[0, 0, 5 + kind, r, c] = 6.0
        return values

    return forward


GOOD = (0.3, 0.5, 0.2, 0.8, 0)


def test_a_found_person_counts_once(pictures: Pictures) -> None:
    found = report.find_all(pictures, CFG, forward_of(GOOD))
    result = scoring.figures(found, 0.5)
    assert result["persons 1-6 m, half of the figure seen: there"] == 1
    assert result["persons 1-6 m, half of the figure seen: found"] == 1
    assert (result["person: boxes"], result["person: false"]) == (1, 0)
    assert scoring.average_precision(found, 0) == pytest.approx(1.0)
    assert "1/1 = 100.00 %" in scoring.say(result)


def test_a_box_beside_the_person_is_a_miss_and_a_false_alarm(pictures: Pictures) -> None:
    found = report.find_all(pictures, CFG, forward_of((0.8, 0.5, 0.2, 0.7, 0)))
    result = scoring.figures(found, 0.5)
    assert result["persons 1-6 m, half of the figure seen: found"] == 0
    assert (result["person: boxes"], result["person: false"]) == (1, 1)
    assert result["person: false where there is none"] == 0
    assert scoring.average_precision(found, 0) == 0.0


def test_a_person_taken_for_a_hydrant_is_false(pictures: Pictures) -> None:
    result = scoring.figures(report.find_all(pictures, CFG, forward_of((*GOOD[:4], 1))), 0.5)
    assert result["fire hydrant: false where there is none"] == 1
    assert result["persons 1-6 m, half of the figure seen: found"] == 0


def test_a_second_box_on_somebody_is_false(pictures: Pictures) -> None:
    low = (0.3, 0.66, 0.16, 0.33, 0)
    found = report.find_all(pictures, CFG, forward_of(GOOD, low))
    result = scoring.figures(found, 0.5)
    assert (result["person: boxes"], result["person: false"]) == (2, 1)
    assert result["person: false where there is none"] == 0
    assert scoring.average_precision(found, 0) == pytest.approx(1.0)


@pytest.mark.parametrize("box", [GOOD, (0.3, 0.59, 0.16, 0.42, 0)])
def test_a_box_on_somebody_hardly_seen_is_left_out(tmp_path: Path, box) -> None:
    np.save(tmp_path / "set-0000.npy", np.zeros((1, 288, 384, 3), np.uint8))
    np.savez(tmp_path / "set-0000.npz", boxes=np.array([row(part=0.1)], np.float32))
    result = scoring.figures(report.find_all(Pictures.open(tmp_path, "set"), CFG, forward_of(box)), 0.5)
    assert result["persons 1-6 m, half of the figure seen: there"] == 0
    assert result["person: boxes"] == 0


def test_what_suppression_leaves_of_exact_boxes() -> None:
    front, behind = row(box=(0.2, 0.1, 0.4, 0.9)), row(box=(0.25, 0.1, 0.45, 0.9))
    beside = row(picture=1, box=(0.6, 0.1, 0.8, 0.9))
    covered = row(picture=1, box=(0.6, 0.1, 0.82, 0.9), whole=0.3)
    unasked = row(picture=2, box=(0.2, 0.1, 0.41, 0.9), part=0.1, whole=0.1)
    labels = np.array([front, behind, beside, covered, row(picture=2), unasked])
    found = scoring.Found(np.zeros((0, 9)), labels, np.zeros(6), np.zeros((3, 2), int))
    aimed = scoring.groups(found)[scoring.AIMED]
    assert aimed.tolist() == [True, True, True, False, True, False]
    assert scoring.spared(found, aimed.astype(float)) == 3  # of front and behind one goes
    assert scoring.spared(found, (~aimed).astype(float)) == 2  # and the one whom somebody less seen overlaps
    assert "theirs the surest: 3/4 = 75.00 %" in scoring.say_spared(found)
    assert "theirs the least sure: 2/4 = 50.00 %" in scoring.say_spared(found)


def test_what_is_found_at_a_precision() -> None:
    # four sure boxes right, one false, two more right, one false: six of the eight persons
    rows = np.array([row(picture=i) for i in range(8)], np.float32)
    boxes = np.zeros((8, 9))
    boxes[:, 2] = 0.95, 0.9, 0.85, 0.8, 0.7, 0.6, 0.5, 0.4
    boxes[:, 7] = 0, 1, 2, 3, -1, 4, 5, -1
    hit = np.array([0.95, 0.9, 0.85, 0.8, 0.6, 0.5, 0, 0])
    found = scoring.Found(boxes, rows, hit, np.zeros((8, 2), int))
    assert scoring.found_at(found, 1.0) == (0.8, 4, 8)
    assert scoring.found_at(found, 0.85) == (0.5, 6, 8)
    assert scoring.found_at(found, 0.7) == (0.4, 6, 8)
    boxes[:, 2] = 0.9  # as sure as the false ones: there is no threshold between them
    assert scoring.found_at(found, 0.8) == (1.0, 0, 8)
    assert "precision of 99.5% (threshold 1.000): 0/8 = 0.00 %" in scoring.say_found_at(found)


@pytest.mark.parametrize(
    ("boxes", "expected"),
    [
        ([GOOD], (0, 0, 0, 0)),
        ([(0.3, 0.3, 0.2, 0.36, 0)], (1, 0, 0, 0)),
        ([GOOD, (0.3, 0.66, 0.16, 0.33, 0)], (0, 1, 0, 0)),
        ([(0.8, 0.5, 0.2, 0.7, 0)], (0, 0, 1, 0)),
    ],
)
def test_false_alarms_are_told_by_what_they_are(pictures: Pictures, boxes, expected) -> None:
    found = report.find_all(pictures, CFG, forward_of(*boxes))
    assert tuple(scoring.false_alarms(found, 0.5).values()) == expected
    assert scoring.say_false_alarms(found, [0.5]).startswith(f"{sum(expected)} false boxes of persons above 0.5:")
    assert sum(scoring.false_alarms(found, 0.99).values()) == 0


def test_a_false_alarm_where_nobody_is() -> None:
    boxes = np.zeros((1, 9))
    boxes[0, [0, 2, 7]] = 1, 0.9, -1
    found = scoring.Found(boxes, np.array([row(kind=1, picture=1)], np.float32), np.zeros(1), np.zeros((2, 2), int))
    assert scoring.false_alarms(found, 0.5)["in a picture with no person"] == 1


def test_a_set_without_contrast_is_taken_as_clear(tmp_path: Path) -> None:
    np.save(tmp_path / "old-0000.npy", np.zeros((1, 288, 384, 3), np.uint8))
    np.savez(tmp_path / "old-0000.npz", boxes=np.array([row()[:-1]], np.float32))
    assert asked(Pictures.open(tmp_path, "old").labels[0][0]).tolist() == [True]


def test_pictures_of_another_size_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "old-0000.npy", np.zeros((1, 240, 320, 3), np.uint8))
    np.savez(tmp_path / "old-0000.npz", boxes=np.array([row()], np.float32))
    with pytest.raises(ValueError, match=r"old-0000.npy holds pictures of 320 x 240, not 384 x 288"):
        Pictures.open(tmp_path, "old")


def test_the_interval_is_wilson_s() -> None:
    # Newcombe 1998, table I: 81 of 263, and 0 of 20
    assert np.allclose(scoring.wilson(81, 263), (0.2553, 0.3662), atol=5e-5)
    assert np.allclose(scoring.wilson(0, 20), (0.0, 0.1611), atol=5e-5)


def test_sheets_are_drawn(pictures: Pictures, tmp_path: Path) -> None:
    found = report.find_all(pictures, CFG, forward_of((0.8, 0.5, 0.2, 0.7, 0)))
    report.draw_worst(pictures, found, 0.5, tmp_path / "worst.jpg")
    report.draw_found(pictures, found, 0.5, tmp_path / "found.jpg", count=5)
    report.draw_samples(pictures, tmp_path / "samples.jpg", count=2)
    assert all((tmp_path / f"{n}.jpg").stat().st_size > 1000 for n in ("worst", "found", "samples"))


def test_from_the_command_line_into_folders_that_are_not_there(
    pictures: Pictures, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    network = ["--cfg", str(CFG), "--weights", str(CFG.with_suffix(".weights"))]
    to = ["--json", str(tmp_path / "a" / "report.json"), "--sheets", str(tmp_path / "b")]
    monkeypatch.setattr("sys.argv", ["report", "--data", str(tmp_path), "--name", "set", *network, *to])
    report.main()
    assert "average precision, person: 0.0000" in capsys.readouterr().out
    assert len(json.loads((tmp_path / "a" / "report.json").read_text())["thresholds"]) == 1
    assert {"worst_set.jpg", "found_set.jpg"} <= {file.name for file in (tmp_path / "b").iterdir()}
