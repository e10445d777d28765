"""The newest values, their viewers, the map's picture, and orders with who may give them."""

from __future__ import annotations

import asyncio
import base64
import io
import json
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rosbot_patrol.console.access.accounts import Accounts, Role
from rosbot_patrol.console.access.door import Door
from rosbot_patrol.console.access.order_log import Order, OrderLog
from rosbot_patrol.console.live import orders
from rosbot_patrol.console.live.house_state import GuardNow
from rosbot_patrol.console.live.hub import CAMERA, Hub
from rosbot_patrol.console.live.map_picture import draw_map, draw_seen
from rosbot_patrol.console.live.orders import Answer, Desk, Visitor
from rosbot_patrol.grid import Grid, GridInfo


def test_only_a_change_counts() -> None:
    hub = Hub()
    for _ in range(3):
        hub.change(guard=GuardNow(doing="idle"))
        hub.move(robot=(1.0, 2.0, 0.0))
    assert (hub.version, hub.scene_version) == (1, 1)
    hub.count_incident()
    assert hub.version == 2


def test_viewers_are_counted() -> None:
    hub, told = Hub(), []
    hub.on_viewers = lambda subject, count: told.append((subject, count))
    with hub.viewer(CAMERA), hub.viewer(CAMERA):
        pass
    assert told == [(CAMERA, 1), (CAMERA, 2), (CAMERA, 1), (CAMERA, 0)]


def test_each_viewer_gets_the_newest_picture() -> None:
    hub = Hub()

    async def run() -> list[tuple[bytes, int]]:
        waiting = [asyncio.create_task(hub.picture_after(0)) for _ in range(3)]
        await asyncio.sleep(0.01)
        hub.show(b"first")
        return await asyncio.gather(*waiting)

    assert asyncio.run(run()) == [(b"first", 1)] * 3
    hub.show(b"second")
    assert asyncio.run(hub.picture_after(1)) == (b"second", 2)


def test_the_map_shows_what_is_known_and_where() -> None:
    cells = np.full((100, 200), -1, np.int8)
    cells[40:60, 50:150] = 0
    cells[59, 50:150] = 100  # the wall of the highest y
    grid = Grid(GridInfo(resolution=0.1, width=200, height=100, origin_x=-5.0, origin_y=-3.0), cells)
    picture = draw_map(grid, 7)
    image = Image.open(io.BytesIO(picture.png))
    assert image.size == (picture.width, picture.height) == (110, 30)
    column, row = picture.pixel(0.05, 2.95)  # in the wall
    assert image.getpixel((int(column), int(row)))[:3] == (52, 60, 72)
    assert image.getpixel((int(column), int(row) + 3))[:3] == (244, 246, 248)
    assert image.getpixel((0, 0))[3] == 0
    assert picture.place(*picture.pixel(1.5, 2.0)) == pytest.approx((1.5, 2.0))
    empty = draw_map(Grid(grid.info, np.full((100, 200), -1, np.int8)), 8)
    assert (empty.width, empty.height) == (200, 100)


class Robot:
    """Records all orders."""

    def __init__(self) -> None:
        self.told: list[tuple[object, ...]] = []
        self.is_slow = False

    def look(self, room_id: int) -> Answer:
        return self._take("look", room_id)

    def look_at_all(self) -> Answer:
        return self._take("all")

    def home(self) -> Answer:
        return self._take("home")

    def cancel(self) -> Answer:
        return self._take("cancel")

    def stop(self, *, pressed: bool) -> Answer:
        return self._take("stop", pressed)

    def arm(self, mode: str) -> Answer:
        return self._take("arm", mode)

    def drive_to(self, x: float, y: float) -> Answer:
        return self._take("drive_to", x, y)

    def drive(self, forward: float, turn: float) -> None:
        self._take("drive", forward, turn)

    def _take(self, *told: object) -> Answer:
        if self.is_slow:
            time.sleep(0.3)
        self.told.append(told)
        return Answer(accepted=True, text="done")


class Scene:
    def __init__(self, folder: Path) -> None:
        self.accounts = Accounts(folder / "accounts.json")
        for name, role in (("Ada", Role.OWNER), ("Max", Role.MEMBER), ("Guy", Role.GUEST)):
            self.accounts.add(name, role, "correct horse")
        self.accounts.set_code("2468")
        self.robot, self.path = Robot(), folder / "orders.jsonl"
        self.desk = Desk(self.robot, Door(self.accounts, b"s" * 32, lambda: 0.0), OrderLog(self.path), lambda: 1.5e9)

    def visitor(self, name: str) -> Visitor:
        account = self.accounts.find(name)
        assert account is not None
        return Visitor(account=account, peer="10.0.0.9")

    def all_orders(self, visitor: Visitor) -> list[Answer]:
        desk = self.desk

        async def give() -> list[Answer]:
            return [
                await desk.look(visitor, 3, "kitchen"),
                await desk.look_at_all(visitor),
                await desk.home(visitor),
                await desk.cancel(visitor),
                await desk.stop(visitor, pressed=True),
                await desk.stop(visitor, pressed=False),
                await desk.arm(visitor, "night"),
                await desk.arm(visitor, "disarmed", "2468"),
                await desk.drive_to(visitor, 1.0, 2.0),
            ]

        return asyncio.run(give())


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return Scene(tmp_path)


@pytest.mark.parametrize("name", ["Ada", "Max"])
def test_owners_and_members_give_orders(scene: Scene, name: str) -> None:
    assert all(answer.accepted for answer in scene.all_orders(scene.visitor(name)))
    assert scene.desk.drive(scene.visitor(name), 5.0, -0.5)
    assert scene.robot.told[-1] == ("drive", 1.0, -0.5)
    assert len(scene.robot.told) == 10


def test_a_guest_gives_none_and_each_try_is_on_record(scene: Scene) -> None:
    answers = scene.all_orders(scene.visitor("Guy"))
    assert {answer.text for answer in answers} == {"Guests give no orders."}
    assert not scene.desk.drive(scene.visitor("Guy"), 1.0, 0.0)
    assert scene.robot.told == []
    lines = [json.loads(line) for line in scene.path.read_text().splitlines()]
    assert len(lines) == len(answers)
    assert {(line["who"], line["peer"], line["accepted"]) for line in lines} == {("Guy", "10.0.0.9", False)}


def test_whoever_was_removed_gives_none_from_an_open_page(scene: Scene) -> None:
    visitor = scene.visitor("Max")
    scene.accounts.remove("Max")
    assert {answer.text for answer in scene.all_orders(visitor)} == {"You are signed out: sign in again."}
    assert not scene.desk.drive(visitor, 1.0, 0.0)
    assert scene.robot.told == []


def test_disarming_needs_the_code(scene: Scene) -> None:
    ada = scene.visitor("Ada")
    assert asyncio.run(scene.desk.arm(ada, "disarmed", "1111")) == Answer(accepted=False, text="The code is wrong.")
    assert asyncio.run(scene.desk.arm(ada, "armed_away")).accepted
    assert scene.robot.told == [("arm", "armed_away")]


def test_an_order_that_nobody_answers_ends(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(orders, "_PATIENCE", 0.05)
    scene.robot.is_slow = True
    answer = asyncio.run(scene.desk.home(scene.visitor("Ada")))
    assert answer == Answer(accepted=False, text="The guard does not answer.")


def test_the_log_of_orders_is_read_again_and_bounded(tmp_path: Path) -> None:
    path = tmp_path / "console" / "orders.jsonl"
    log = OrderLog(path)
    order = Order(wall=1.0, who="Ada", peer="::1", what="x" * 60_000, accepted=True, answer="done")
    for _ in range(30):
        log.add(order)
    assert path.stat().st_size < 1 << 21
    assert path.with_suffix(".old.jsonl").exists()
    with path.open("a") as file:
        file.write('{"cut')
    assert OrderLog(path).newest[0] == order


def test_a_disk_that_takes_nothing_refuses_no_order(tmp_path: Path) -> None:
    (tmp_path / "console").write_text("a file where the folder should be")
    log = OrderLog(tmp_path / "console" / "orders.jsonl")
    log.add(Order(wall=1.0, who="Ada", peer="::1", what="stop", accepted=True, answer="done"))
    assert len(log.newest) == 1


def test_the_seen_floor_is_a_picture_with_its_place() -> None:
    cells = np.full((10, 20), -1, np.int8)
    grid = Grid(GridInfo(resolution=0.1, width=20, height=10, origin_x=-1.0, origin_y=2.0), cells)
    assert draw_seen(grid) is None
    cells[2:5, 4:8] = 100
    seen = draw_seen(grid)
    assert seen is not None
    assert (seen.left, seen.right, seen.bottom, seen.top) == pytest.approx((-0.6, -0.2, 2.2, 2.5))
    picture = Image.open(io.BytesIO(base64.b64decode(seen.png)))
    assert picture.size == (4, 3)
