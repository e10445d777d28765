import io
import itertools

import numpy as np
import pytest
from PIL import Image, ImageFilter

from rosbot_patrol.alerts.pictures.album import Album, Sighting
from rosbot_patrol.alerts.pictures.jpeg import EncodedPicture, LabelledBox, RawPicture
from rosbot_patrol.alerts.pictures.ring import Candidate, Clip, EvidenceParams, EvidenceRing, best_pictures, sharpness


def raw(stamp, size=48 * 64 * 3):
    return RawPicture(stamp=stamp, width=64, height=48, encoding="rgb8", step=192, data=bytes([90]) * size)


def fill(ring, first, last, hz=10.0):
    for i in range(round((last - first) * hz) + 1):
        ring.add(raw(first + i / hz))


def test_the_newest_are_all_there_and_older_ones_thinned():
    ring = EvidenceRing(seconds=5.0, rate=5.0, max_bytes=1e9, fresh=1.0)
    fill(ring, 100.0, 110.0)
    stamps = [p.stamp for p in (*ring._old, *ring._new)]
    assert stamps[0] >= 105.0 - 0.21
    assert [s for s in stamps if s > 109.0] == pytest.approx([109.1 + i / 10 for i in range(10)])
    gaps = np.diff([s for s in stamps if s < 108.9])
    assert gaps.min() > 0.19
    assert len(ring) < 35


def test_memory_is_bounded():
    ring = EvidenceRing(seconds=100.0, rate=5.0, max_bytes=100_000)
    fill(ring, 0.0, 60.0)
    assert ring.bytes <= 100_000
    assert ring.bytes == sum(len(p.data) for p in (*ring._old, *ring._new))
    assert ring.newest.stamp == pytest.approx(60.0)


def test_where_memory_is_short_the_newest_leave_room_for_the_seconds_before():
    ring = EvidenceRing(seconds=6.0, rate=5.0, max_bytes=43 * len(raw(0.0).data))
    fill(ring, 100.0, 110.0, hz=30.0)
    assert ring.bytes <= 43 * len(raw(0.0).data)
    stamps = [p.stamp for p in (*ring._old, *ring._new)]
    assert stamps[0] < 106.0  # it reached back to 108.6
    assert [s for s in stamps if s > 109.4] == pytest.approx([109.4 + i / 30 for i in range(1, 19)])


def test_one_huge_picture_is_kept_alone():
    ring = EvidenceRing(seconds=5.0, rate=5.0, max_bytes=1000)
    ring.add(raw(1.0))
    ring.add(raw(1.1))
    assert len(ring) == 1


def test_a_clock_that_goes_back_forgets_what_was_later():
    ring = EvidenceRing(seconds=5.0, rate=5.0, max_bytes=1e9)
    fill(ring, 100.0, 101.0)
    ring.add(raw(50.0))
    assert len(ring) == 1
    assert ring.bytes == len(raw(0.0).data)


def test_the_picture_of_a_detection_is_found():
    ring = EvidenceRing(seconds=5.0, rate=5.0, max_bytes=1e9)
    fill(ring, 100.0, 101.0)
    assert ring.find(100.5001, 0.002).stamp == pytest.approx(100.5)
    assert ring.find(100.55, 0.002) is None
    assert EvidenceRing(seconds=1.0, rate=1.0, max_bytes=1).find(1.0, 9.0) is None


def test_a_clip_holds_the_seconds_before_and_after_each_picture_once():
    params = EvidenceParams(evidence_before=2.0, evidence_after=3.0)
    ring = EvidenceRing(seconds=3.0, rate=5.0, max_bytes=1e9)
    clip = Clip.around("a", 110.0, params)
    stamps = []
    for tenth in range(1060, 1160):
        ring.add(raw(tenth / 10))
        if tenth >= 1100 and tenth % 7 == 0:
            stamps += [p.stamp for p in clip.take(ring)]
            if clip.is_over(ring):
                break
    assert stamps == sorted(set(stamps))
    assert stamps[0] == pytest.approx(108.0, abs=0.21)
    assert stamps[-1] == pytest.approx(113.0, abs=0.11)
    assert len(stamps) == pytest.approx(25, abs=4)
    assert max(np.diff(stamps)) <= 0.31


def test_without_pictures_a_clip_is_over_at_once():
    ring = EvidenceRing(seconds=3.0, rate=5.0, max_bytes=1e9)
    assert Clip.around("a", 1.0, EvidenceParams()).is_over(ring)


@pytest.mark.parametrize("by", [60.0, 3600.0])
def test_a_clip_ends_where_the_clock_is_set_back(by):
    ring = EvidenceRing(seconds=3.0, rate=5.0, max_bytes=1e9)
    clip = Clip.around("a", 5000.0, EvidenceParams())
    fill(ring, 4998.0, 5001.0)
    assert clip.take(ring)
    assert not clip.is_over(ring)
    ring.add(raw(5001.0 - by))
    assert clip.is_over(ring)


def test_the_best_are_sure_large_and_sharp():
    stamps = itertools.count(0.0, 2.0)

    def candidate(name, probability=0.9, share=0.1, sharp=100.0, stamp=None):
        stamp = next(stamps) if stamp is None else stamp
        return Candidate(name=name, stamp=stamp, probability=probability, share=share, sharpness=sharp)

    assert best_pictures([candidate("small", share=0.01), candidate("large")]) == ["large", "small"]
    assert best_pictures([candidate("blurred", sharp=5.0), candidate("sharp")]) == ["sharp", "blurred"]
    assert best_pictures([candidate("unsure", probability=0.5), candidate("sure")])[0] == "sure"
    assert best_pictures([candidate(str(i), sharp=0.0) for i in range(9)], 2) == ["0", "1"]
    assert best_pictures([]) == []
    close = [candidate("a", 0.9, stamp=1.0), candidate("b", 0.95, stamp=1.5), candidate("c", 0.5, stamp=3.0)]
    assert best_pictures(close) == ["b", "c"]


def test_sharpness_falls_with_blur():
    noise = Image.fromarray(np.random.default_rng(1).integers(0, 255, (240, 320, 3), dtype=np.uint8)).resize((640, 480))

    def jpeg(image):
        out = io.BytesIO()
        image.save(out, "JPEG")
        return out.getvalue()

    assert sharpness(jpeg(noise)) > 2 * sharpness(jpeg(noise.filter(ImageFilter.GaussianBlur(6))))


def album_of(ring, **given):
    album = Album(EvidenceParams(evidence_before=1.0, evidence_after=1.0, **given))
    album.begin("m")
    return album


def test_an_album_names_and_numbers_what_it_takes_and_picks_the_best():
    ring = EvidenceRing(seconds=3.0, rate=5.0, max_bytes=1e9)
    fill(ring, 100.0, 103.0)
    album = album_of(ring)
    for stamp, probability in ((101.2, 0.7), (101.4, 0.95), (101.6, 0.8), (101.8, 0.75)):
        box = LabelledBox(text="person", xmin=5, ymin=5, xmax=30, ymax=45)
        album.note(Sighting(stamp=stamp, probability=probability, boxes=[box]))
    album.sight("m", 101.2)
    assert album.is_waiting
    files = album.take("m", ring)
    assert [f.role for f in files] == ["before"] * 5 + ["after"] * 5
    assert files[0].name == "before-001.jpg"
    assert all(f.data.startswith(b"\xff\xd8") for f in files)
    assert not album.is_waiting
    album.sight("m", 102.0)  # seen again: one clip a record
    assert album.take("m", ring) == []
    best = album.finish("m")
    assert [f.caption for f in best] == ["probability 0.95"]  # the others are less than a second from it
    assert album.finish("m") == []


def test_a_look_around_gives_a_picture_now_and_then():
    ring = EvidenceRing(seconds=3.0, rate=5.0, max_bytes=1e9)
    album = album_of(ring, look_pictures=3)
    assert album.look("m", ring) == []
    names = []
    for i in range(100):
        ring.add(raw(100.0 + i / 10))
        names += [f.name for f in album.look("m", ring)]
    assert names == ["look-01.jpg", "look-02.jpg", "look-03.jpg"]


def test_compressed_pictures_go_in_as_they_are_and_broken_ones_are_said():
    out = io.BytesIO()
    Image.new("RGB", (64, 48), (10, 200, 30)).save(out, "JPEG")
    ring = EvidenceRing(seconds=3.0, rate=5.0, max_bytes=1e9)
    ring.add(EncodedPicture(stamp=1.0, data=out.getvalue()))
    ring.add(EncodedPicture(stamp=1.5, data=b"\xff\xd8 broken"))
    ring.add(EncodedPicture(stamp=2.0, data=b"nothing"))
    album = album_of(ring)
    for stamp in (1.5, 2.0):
        album.note(
            Sighting(stamp=stamp, probability=0.9, boxes=[LabelledBox(text="x", xmin=0, ymin=0, xmax=9, ymax=9)])
        )
    album.sight("m", 1.5)
    assert album.take("m", ring)[0].data == out.getvalue()
    assert any("cannot be read" in problem for problem in album.problems)
