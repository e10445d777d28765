"""The guide from nothing to a guarded house, by the browser alone: scripts/patrol new_house:=true."""

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from console_browser import Browser

from rosbot_patrol.campaign.houses.drawn import drawn_house_files
from rosbot_patrol.console.live.map_picture import draw_map
from rosbot_patrol.maps.map_io import read_map
from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.simulation.plans.catalogue import load_catalogue

ROOT = Path(__file__).parents[2]
DRAWN = 1_000_203  # seed of a house that nobody has made by hand


@pytest.fixture
def place(request, tmp_path):
    """Arguments of the launch, names of map, rooms and sensors in the house's folder, and the points to tap."""
    if request.param == "flat":
        return (
            ["house:=flat"],
            ("flat_map", "flat_room_points", "flat_sensors"),
            ((0.0, 0.0, "base"), (3.0, 0.3, "study")),
        )
    folder = tmp_path / "drawn"
    files = drawn_house_files(DRAWN, folder, load_catalogue(ROOT / "config"))
    points = [(room.pose.x, room.pose.y, f"my {room.name}") for room in load_rooms(files.rooms)]
    return [f"world:={files.world}", f"motion_sensors:={files.sensors}"], ("rosbot_map", "room_points", ""), points


@pytest.fixture
def patrol(tmp_path, place):
    env = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    env |= {"ROS_MASTER_URI": "http://localhost:11391", "ROS_HOME": str(tmp_path / "ros")}
    command = [str(ROOT / "scripts" / "patrol"), "new_house:=true", *place[0], "rate:=0", "gui:=false"]
    command += ["console_port:=18440", f"state_dir:={tmp_path / 'state'}", "browser:=false"]
    log = (tmp_path / "words").open("w")
    process = subprocess.Popen(command, env=env, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
    process.words = tmp_path / "words"
    yield process
    process.send_signal(signal.SIGINT)
    process.wait(60)


def wait_for(condition, seconds, what):
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, what
        time.sleep(0.2)
    return found


@pytest.mark.long
@pytest.mark.parametrize("place", ["flat", "drawn"], indirect=True)
def test_from_nothing_to_a_guarded_house(patrol, place, tmp_path):
    _, (map_name, rooms_name, sensors_name), points = place
    room = points[1][2]
    words = lambda: patrol.words.read_text()  # noqa: E731
    wait_for(lambda: "Set up the house on the page" in words(), 120, words())
    url = words().partition("on the page ")[2].split()[0]
    page = Browser(url, size=(1440, 2400))
    try:
        page.open("/")
        page.see("A new house")
        for device in ("Lidar: works", "Wheels: works", "Camera: works"):
            page.see(device)
        page.save("guide-devices")
        page.press("Next")
        page.press("Explore")
        page.see("the robot explores the house".capitalize()[:20])
        page.see("The map is ready.", 400.0)
        page.save("guide-map")
        page.press("Next")
        page.see("None yet. The first one is the base")
        house = tmp_path / "state" / "house"
        for x, y, name in points:
            page.press("Add a room")
            tap(page, house / f"{map_name}.yaml", x, y)
            page.type("Name", name)
            page.press("Save")
            page.see(name)
        page.save("guide-rooms")
        assert [each.name for each in load_rooms(house / f"{rooms_name}.yaml")] == [name for _, _, name in points]
        for _ in range(3):
            page.press("Next")
        page.press("Start the guard")
        page.see("The guard starts.")
        page.see("On guard. All is quiet.", 120.0)
        if sensors_name:  # else there was a file of the sensors before
            assert (house / f"{sensors_name}.yaml").exists()
        page.save("guide-guard")
        page.press("Look at all rooms")
        page.see("Looking around in", 300.0)
        page.open("/house")
        page.see(f"1 {room}")
    finally:
        page.close()


def tap(page, map_file, x, y):
    """Tap a place of the house on the map."""
    drawn = draw_map(read_map(map_file), 1)
    column, row = drawn.pixel(x, y)
    plans = [p for p in page.driver.find_elements("css selector", ".console-map") if p.is_displayed()]
    page.driver.execute_script(
        "const r = arguments[0].getBoundingClientRect();"
        "arguments[0].dispatchEvent(new MouseEvent('click', {bubbles: true,"
        " clientX: r.left + arguments[1] * r.width, clientY: r.top + arguments[2] * r.height}));",
        plans[-1],
        column / drawn.width,
        row / drawn.height,
    )
