import dataclasses
import io
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from rosbot_patrol.alerts.pictures.map import Marks, crop_map, draw_map, view_of_marks
from rosbot_patrol.alerts.records.chain import make_link
from rosbot_patrol.alerts.records.incident import Event, StoredFile
from rosbot_patrol.alerts.report.page import Evidence, render_report
from rosbot_patrol.alerts.report.style import STYLE
from rosbot_patrol.grid import Grid, GridInfo

EVIL = "<script>alert('x')</script>\"><img src=x onerror=alert(1)>&amp;\0\x1b[31m"


def jpeg(colour=(200, 60, 20)):
    out = io.BytesIO()
    Image.new("RGB", (640, 480), colour).save(out, "JPEG")
    return out.getvalue()


class Reader(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.links, self.handlers, self.text, self.open = [], [], [], "", []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)
        self.links += [value for name, value in attrs if name in ("src", "href")]
        self.handlers += [name for name, _ in attrs if name.startswith("on")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


@pytest.fixture
def full(make_incident):
    roles = ["detection", "best", "map", "before", "after", "look"]
    files = tuple(
        StoredFile(name=f"{role}.jpg", role=role, sha256="a" * 64, size=10, stamp=60.0 + i, caption=f"the {role} one")
        for i, role in enumerate(roles)
    )
    wall = 1_790_000_000.0
    return make_incident(
        times=(("driving", wall), ("looking", wall + 12.0), ("returning", wall + 31.0)),
        closed=wall + 50.0,
        confirmed=wall + 14.0,
        share_seen=0.97,
        person=(4.56, -1.25),
        person_room="hall",
        events=(Event(wall=wall, kind="sensor", text="motion sensor 3 sees motion"),),
        files=files,
    )


def test_all_of_it_is_in_one_file(full):
    link = make_link((6, "b" * 64), "record", full.id, 1.0, "{}")
    added = [Event(wall=full.wall + 99.0, kind="note", text="it was the plumber")]
    text = render_report(full, Evidence(read=lambda _: jpeg(), link=link, amendments=added))
    seen = Reader(text)
    assert seen.open == []
    for word in ("Room 3 (Küche – 台所)", "confirmed", "person, probability 0.87", "97 % of the room's", "x 4.56 m"):
        assert word in seen.text
    for word in ("motion sensor 3 sees motion", "it was the plumber", "driving 12 s", "looking 19 s", "returning 19 s"):
        assert word in seen.text
    assert link.hash in text
    assert "a" * 64 in text
    assert all(link.startswith("data:image/") for link in seen.links)
    assert len(seen.links) == 2 + 1 + 3
    assert not re.search(r"https?:", text)
    assert "default-src 'none'" in text
    assert "viewport" in text


@pytest.mark.parametrize(
    "name", ["room_name", "reason", "object_class", "origin", "person_room", "phase", "verdict", "id"]
)
def test_nothing_that_comes_from_outside_is_markup(full, name):
    plain = Reader(render_report(full, Evidence(read=lambda _: jpeg())))
    evil = Reader(render_report(dataclasses.replace(full, **{name: EVIL}), Evidence(read=lambda _: jpeg())))
    assert evil.tags == plain.tags
    assert evil.handlers == []
    assert "script" not in evil.tags
    assert "\0" not in evil.text
    assert "\x1b" not in evil.text


def test_events_captions_and_phases_are_no_markup_either(full):
    evil = dataclasses.replace(
        full,
        events=(Event(wall=1.0, kind=EVIL, text=EVIL),),
        files=tuple(dataclasses.replace(f, caption=EVIL, name="x.jpg") for f in full.files),
        times=((EVIL, full.wall), ("looking", full.wall + 2.0)),
    )
    seen = Reader(render_report(evil, Evidence(read=lambda _: jpeg())))
    assert "script" not in seen.tags
    assert seen.handlers == []


@pytest.mark.parametrize("content", [None, b"", b"no picture", b"\xff\xd8 broken"])
def test_pictures_that_are_gone_or_broken_are_said(full, content):
    seen = Reader(render_report(full, Evidence(read=lambda _: content)))
    assert "cannot be shown" in seen.text


def test_a_record_with_nothing_in_it(make_incident):
    bare = dataclasses.replace(
        make_incident(), verdict="", reason="", object_class="", pose=None, room_name="", probability=0.0
    )
    seen = Reader(render_report(bare, Evidence(read=lambda _: None)))
    assert "still running" in seen.text
    assert "not in the chain yet" in seen.text


def small_map():
    cells = np.full((400, 600), -1, np.int8)
    cells[100:300, 200:500] = 0
    cells[100:300, 200] = 100
    return Grid(GridInfo(resolution=0.05, width=600, height=400, origin_x=-10.0, origin_y=-5.0), cells)


def test_the_map_is_cut_to_what_is_known_and_the_marks_are_where_they_belong():
    view = crop_map(small_map())
    assert view.shades.shape == (220, 320)
    assert (view.x, view.y) == pytest.approx((-0.5, -0.5))
    picture = draw_map(view, Marks(path=[(1.0, 1.0), (10.0, 8.0)], robot=(3.0, 8.0, 0.0), person=(12.0, 2.0)))
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    assert max(image.size) == 900

    def at(x, y):
        scale = 900 / 320 / 0.05
        return image.getpixel((round((x + 0.5) * scale), round(image.height - (y + 0.5) * scale)))

    def is_like(pixel, colour):
        return max(abs(a - b) for a, b in zip(pixel, colour, strict=True)) < 60

    assert is_like(at(12.0, 1.95), (210, 30, 30))
    assert is_like(at(3.0, 8.0), (20, 80, 200))
    assert is_like(at(5.5, 4.5), (120, 160, 220))
    assert is_like(at(0.02, 5.0), (40, 40, 40))
    assert is_like(at(13.0, 9.0), (255, 255, 255))


def test_an_empty_map_and_none_at_all_can_be_drawn_on():
    empty = Grid(GridInfo(resolution=0.05, width=20, height=20), np.full((20, 20), -1, np.int8))
    for view in (crop_map(empty), view_of_marks(Marks()), view_of_marks(Marks(path=[(0, 0), (3, 1)], person=(2, 2)))):
        assert draw_map(view, Marks(path=[(0, 0), (1, 1)], person=(50.0, 50.0))).startswith(b"\x89PNG")


def test_only_the_last_column_may_break_a_word():
    assert "th, td { overflow-wrap: break-word; }" in STYLE
    assert "td:last-child { overflow-wrap: anywhere; }" in STYLE
