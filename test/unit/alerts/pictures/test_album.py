"""The album between the thread that collects and those that tell it things."""

import io
import sys
import threading

import pytest
from PIL import Image

from rosbot_patrol.alerts.pictures.album import Album, Sighting
from rosbot_patrol.alerts.pictures.jpeg import EncodedPicture, LabelledBox
from rosbot_patrol.alerts.pictures.ring import EvidenceParams, EvidenceRing

BOX = LabelledBox(text="person", xmin=1, ymin=1, xmax=9, ymax=9)


def picture(stamp):
    out = io.BytesIO()
    Image.new("RGB", (16, 12)).save(out, "JPEG")
    return EncodedPicture(stamp=stamp, data=out.getvalue())


def ring_of(*stamps):
    ring = EvidenceRing(seconds=10.0, rate=5.0, max_bytes=1e9)
    for stamp in stamps:
        ring.add(picture(stamp))
    return ring


class Between:
    """A sighting that lets another thread work while the album looks at it."""

    probability, boxes = 0.9, (BOX,)

    def __init__(self, work):
        self._work = work

    @property
    def stamp(self):
        thread = threading.Thread(target=self._work)
        thread.start()
        thread.join(0.05)  # it waits for the album, or has done its work
        return 0.0


def test_a_sighting_that_comes_while_pictures_are_judged_harms_nothing():
    album = Album(EvidenceParams(evidence_before=1.0, evidence_after=1.0))
    later = Sighting(stamp=100.0, probability=0.8, boxes=[BOX])
    for _ in range(3):
        album.note(Between(lambda: album.note(later)))
    album.sight("m", 100.0)
    assert len(album.take("m", ring_of(100.0))) == 1
    assert len(album.take("m", ring_of(100.4))) == 1


def test_a_mission_that_begins_while_another_thread_asks_for_pictures_harms_nothing():
    """`is_waiting` is asked in each step of the patrol, whose thread must not end."""
    before = sys.getswitchinterval()
    album, ring, over = Album(EvidenceParams()), ring_of(100.0), threading.Event()

    def keep():
        for number in range(3000):
            for name in ("a", "b", "c"):
                album.sight(f"{name}{number}", 100.0)
            for name in ("a", "b", "c"):
                album.finish(f"{name}{number}")
        over.set()

    sys.setswitchinterval(1e-5)
    try:
        thread = threading.Thread(target=keep)
        thread.start()
        while not over.is_set():
            assert album.is_waiting in (True, False)
        thread.join()
    finally:
        sys.setswitchinterval(before)
    assert album.take("a0", ring) == []


@pytest.mark.parametrize("stamp", [100.0, 100.001])
def test_a_picture_and_its_sighting_find_each_other(stamp):
    album = Album(EvidenceParams(evidence_before=1.0, evidence_after=1.0))
    album.note(Sighting(stamp=stamp, probability=0.8, boxes=[BOX]))
    album.sight("m", 100.0)
    album.take("m", ring_of(100.0))
    assert [file.caption for file in album.finish("m")] == ["probability 0.80"]
