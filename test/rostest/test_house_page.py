"""The page of the house in a real browser: what it writes, what it refuses, and that the patrol reads it back."""

import contextlib
import http.server
import threading

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from console_browser import Console
from patrol_house import wait_until

from rosbot_patrol.maps.zones import read_zones
from rosbot_patrol.patrol.guard.schedule import load_schedule
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.patrol.intruder.known_objects import load_known
from rosbot_patrol.sensors.sensor_file import load_sensors

TALL = (1100, 1700)  # everything of a page is in view


@pytest.fixture
def console(house):
    console = Console(house)
    yield console
    console.close()


def tap(page, share_x, share_y):
    """Tap the map at shares of its width and height."""
    plan = page.find('//*[contains(@class, "console-map")]')
    box = plan.rect
    page.driver.execute_script(
        "const e = new MouseEvent('click', {bubbles: true, clientX: arguments[1], clientY: arguments[2]});"
        "arguments[0].dispatchEvent(e);",
        plan,
        *page.driver.execute_script(
            "const r = arguments[0].getBoundingClientRect();"
            "return [r.left + arguments[1] * r.width, r.top + arguments[2] * r.height];",
            plan,
            share_x,
            share_y,
        ),
    )
    assert box["height"] > 100


@pytest.mark.long
def test_a_room_is_added_and_the_patrol_drives_there(house, console):
    house.start_move_base()
    house.start_patrol()
    console.start_map()
    console.start()
    page = console.browser("/house", size=TALL)
    page.see("west alcove")
    page.wait(lambda: page.driver.find_elements("xpath", '//*[contains(@class, "console-map")]//*[@class="robot" or '
                                                '@class="room"]'), "the map")  # fmt: skip
    page.press("Add a room")
    page.see("Tap the place that the robot looks from.")
    tap(page, 0.5, 0.001)
    page.see("the map shows no floor there".capitalize()[:10], 10.0)
    page.press("Add a room")
    tap(page, 0.327, 0.862)
    page.see("Room 8")
    page.press("Save")
    page.see("Is empty, expected a name")
    page.type("Name", "West alcove")
    page.press("Save")
    page.see("which room3 has already")
    page.type("Name", "pantry")
    page.press("Save")
    page.see("8 pantry")
    page.save("house-map")
    file = house.folder / "state" / "house" / "room_points.yaml"
    assert [room.name for room in load_rooms(file)][-2:] == ["north-east hall", "pantry"]
    assert "# Room points of the house" in file.read_text()
    wait_until(lambda: "starting anew" in house.log(house.patrol), 15, "the patrol's new start")
    wait_until(lambda: house.log(house.patrol).count("9 rooms in") == 1, 30, "the new rooms")
    wait_until(lambda: house.log(house.patrol).count("idle: on guard") == 2, 30, "on guard again")
    house.send(8)
    wait_until(lambda: house.states[-1].room_name == "pantry", 20, "a mission to the pantry")
    page.press("Undo: 8 (pantry)")
    page.miss("8 pantry")
    assert not file.exists() or len(load_rooms(file)) == 8


@contextlib.contextmanager
def web_address():
    got = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self):
            got.append(self.rfile.read(int(self.headers["Content-Length"])))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_):
            """Say nothing."""

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}/hook", got
    server.shutdown()
    server.server_close()


def test_zones_objects_sensors_rounds_and_channels(house, console):
    console.start_map()
    console.start()
    own = house.folder / "state" / "house"
    page = console.browser("/house", size=TALL)
    page.see("west alcove")
    page.press("Add a keep-out zone")
    tap(page, 0.3, 0.3)
    page.press("Done")
    page.see("A zone needs three corners at least.")
    for corner in ((0.4, 0.3), (0.4, 0.4)):
        tap(page, *corner)
    page.press("Done")
    page.type("Name", "dog's corner")
    page.press("Save")
    wait_until(lambda: len(read_zones(own / "zones.yaml")) == 1, 10, "the zone")
    assert len(read_zones(own / "zones.yaml")[0].points) == 3
    page.see("dog's corner")
    page.press("Add a known object")
    tap(page, 0.35, 0.85)
    page.type("What is it?", "coat stand")
    page.type("Radius [m]", "9")
    page.press("Save")
    page.see("Is 9.0, expected at most 5.0 m")
    page.type("Radius [m]", "0.4")
    page.press("Save")
    page.miss("Nothing that looks like a person alarms there.")
    page.see("coat stand")
    assert [thing.radius for thing in load_known(house.folder / "state" / "known_objects.yaml")] == [0.4]
    page.save("house-zones")

    page.click('//*[@role="tab"][normalize-space()="Sensors"]')
    page.see("Without a list, a sensor's id is the number of its room.")
    house.send(42)
    page.see("calls, and has no room yet")
    page.press_for("Change sensor 42", "Where it hangs")
    page.press("Save")
    page.see("Is missing: choose one")
    page.choose("Room", "guest room")
    page.press("Save")
    page.miss("calls, and has no room yet")
    rooms = load_rooms(console.house_file())
    names = {room.id: room.name for room in rooms}
    listed = load_sensors(own / "sensors.yaml", names, rooms_source="")
    assert (listed.room_of(42), listed.room_of(7), len(listed)) == (1, 7, 8)
    page.save("house-sensors")

    page.click('//*[@role="tab"][normalize-space()="Times"]')
    page.press_for("Change Away", "Guarded rooms")
    page.type("Time to leave [s]", "9999")
    page.press("Save")
    page.see("Is 9999.0, expected at most 600.0 s")
    page.type("Time to leave [s]", "45")
    page.press("Save")
    page.see("all rooms, 45 s to leave")
    page.press_for("Add quiet hours", "Until")
    page.press("Save")
    page.see("22:00 - 06:00")
    page.press_for("Add a round", "Or every so many minutes")
    page.type("Name", "late evening")
    page.type("Times of day, such as 22:30, 02:00", "25:70")
    page.press("Save")
    page.see("expected a time of day such as 22:30")
    page.type("Times of day, such as 22:30, 02:00", "22:30, 02:00")
    page.press("Save")
    page.see("22:30; ")
    (entry,), _ = load_schedule(str(own / "schedule.yaml"), rooms)
    assert (entry.name, entry.minutes, len(entry.rooms)) == ("late evening", (120, 1350), 8)
    page.save("house-times")

    page.click('//*[@role="tab"][normalize-space()="Notices"]')
    page.press_for("Add a phone or chat", "An address of Apprise")
    page.type("Address", "nothing://that-is-known")
    page.press("Save")
    page.see("Holds no address that Apprise knows")
    page.press("Not now")
    page.press_for("Add a mail address", "Encryption")
    page.type("Your mail address", "nobody at home")
    page.type("Mail server", "mail.example.org")
    page.press("Save")
    page.see("Expected a mail address, got 'nobody at home'")
    page.press("Not now")
    assert not (own / "channels.yaml").exists()
    with web_address() as (url, got):
        page.press_for("Add a web address", "as JSON by POST")
        page.type("Address", url)
        page.press("Save")
        page.press("Test web")
        page.see("taken after")
        assert b"This is a test from the robot" in got[0]
    page.save("house-notices")
    assert not page.problems()
