"""The console in a real browser, before a real patrol: sign in, arm, look, what happened, drive, stop."""

import json
import time

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from console_browser import DESK, PHONE, Console
from patrol_house import wait_until


@pytest.fixture
def console(house):
    console = Console(house)
    yield console
    console.close()


def test_from_the_first_visit_to_a_false_alarm(house, console):
    house.start_move_base()
    house.start_patrol()
    console.start_camera()
    console.start_map()
    console.start()
    page = console.browser()
    page.see("On guard. All is quiet.")
    page.see("Set a password to use this page from your phone.")
    page.save("home")

    page.open("/settings")
    page.type("Name", "Ada")
    page.type("Password", "short")
    page.press("Add")
    page.see("The password needs 8 to 200 characters.")
    page.type("Password", "correct horse")
    page.press("Add")
    page.wait(lambda: page.path.startswith("/sign-in"), "the sign-in page")
    page.save("sign-in")
    page.sign_in("Ada", "wrong horse")
    page.see("Name and password do not fit.")
    page.sign_in("Ada", "correct horse")
    page.wait(lambda: page.path == "/settings", "the page that was asked for")
    page.type("4 to 8 digits; empty: none", "2468")
    page.press("Set code")
    page.see("A code is set")

    page.open("/")
    page.press("Disarmed")
    page.type("Code", "1111")
    page.press("Disarm")
    page.see("The code is wrong.")
    page.press("Disarmed")
    page.type("Code", "2468")
    page.press("Disarm")
    page.see("Disarmed: no sensor calls the guard.")
    page.press("Away")
    page.miss("Disarmed: no sensor calls the guard.")

    other = console.browser(size=DESK)
    other.sign_in("Ada", "correct horse")
    other.open("/incidents")
    other.see("Nothing on record that fits.")
    page.press("west alcove")
    page.see("Looking around in west alcove", 40.0)
    house.person = True
    page.see("Somebody is in west alcove!", 40.0)
    page.save("somebody")
    other.see("Person in west alcove", 40.0)
    house.person = False
    page.miss("Somebody is in west alcove!", 60.0)
    other.see("Somebody seen")
    other.save("incidents")
    other.click('//a[contains(@class, "console-card")]')
    other.see("What happened")
    other.save("incident")
    other.press("False alarm")
    other.press("Save")
    other.see("Ada marked it as a false alarm", 40.0)
    orders = [json.loads(line) for line in (console.state / "console" / "orders.jsonl").read_text().splitlines()]
    assert {order["who"] for order in orders} == {"this machine", "Ada"}
    assert [order["accepted"] for order in orders if "mode to disarmed" in order["what"]] == [False, True]
    assert not page.problems()
    assert not other.problems()


def test_driving_and_the_emergency_stop(house, console):
    import rospy
    from geometry_msgs.msg import Twist

    heard = []
    rospy.Subscriber("cmd_vel/teleop", Twist, lambda m: heard.append((time.monotonic(), m.linear.x, m.angular.z)))
    house.start_move_base()
    house.start_patrol()
    console.start()
    page = console.browser("/drive", size=DESK)
    stick = page.find('//*[@id="stick"]')
    page.wait(lambda: stick.get_attribute("data-ready"), "the stick")
    page.driver.execute_script("arguments[0].focus()", stick)

    def key(kind, name):
        page.driver.execute_script(
            "arguments[0].dispatchEvent(new KeyboardEvent(arguments[1], {key: arguments[2], bubbles: true}))",
            stick, kind, name,
        )  # fmt: skip

    key("keydown", "ArrowUp")
    wait_until(lambda: sum(x > 0.1 for _, x, _ in heard) > 8, 10, "driving on while the key is held")
    key("keyup", "ArrowUp")
    wait_until(lambda: heard[-1][1:] == (0.0, 0.0), 2, "the end")
    time.sleep(0.5)
    count = len(heard)
    time.sleep(0.5)
    assert len(heard) == count  # the wheels are left to others

    page.press("Stop")
    page.see("The emergency stop is pressed: the robot does not move.")
    page.press("Release stop")
    page.press("Release")
    page.miss("The emergency stop is pressed")

    key("keydown", "ArrowLeft")
    wait_until(lambda: heard[-1][2] > 0.3, 10, "turning left")
    page.die()
    wait_until(lambda: heard[-1][1:] == (0.0, 0.0), 3, "the end")
    last = next(at for at, x, turn in reversed(heard) if turn)
    assert heard[-1][0] - last < 0.6


PAGES = ("/", "/incidents", "/drive", "/house", "/health", "/settings")


@pytest.mark.parametrize(
    ("size", "dark"),
    [
        pytest.param(PHONE, True, id="phone, dark"),
        pytest.param(DESK, False, id="desk, light", marks=pytest.mark.long),
    ],
)
def test_everybody_can_use_the_pages(house, console, size, dark):
    """axe finds nothing grave: contrast, names of buttons and fields, order of headings, language."""
    house.start_move_base()
    house.start_patrol()
    console.start_map()
    console.start()
    page = console.browser("/sign-in", size=size, dark=dark, language="de")
    found = {"/sign-in": page.inaccessible()}
    for path in PAGES:
        page.open(path)
        page.find("//main")
        page.wait(lambda: "Stopp" in page.text, "the page in German")
        time.sleep(1.0)
        found[path] = page.inaccessible()
        page.save(f"{'phone' if size is PHONE else 'desk'}{path.replace('/', '_')}")
    assert {path: each for path, each in found.items() if each} == {}
    assert not page.problems()


def test_a_guest_orders_nothing_and_sees_nothing_live(house, console):
    house.start_move_base()
    house.start_patrol()
    console.add("Ada", "correct horse")
    console.add("Guy", "battery staple", "guest")
    console.start()
    page = console.browser()
    page.sign_in("Guy", "battery staple")
    page.see("On guard. All is quiet.")
    assert "Stop" not in page.text
    assert "Look now" not in page.text
    page.save("guest")
    for path in ("/camera.mjpg", "/map.png"):
        page.open(path)
        page.see("Guests see nothing live.")
    page.open("/drive")
    page.see("Guests do not drive the robot.")
    page.open("/house")
    page.see("Only owners change the house.")
    console.add("Mel", "battery staple", "member")
    page.driver.delete_all_cookies()
    page.open("/house")
    page.sign_in("Mel", "battery staple")
    page.see("Only owners change the house.")


@pytest.mark.long
def test_a_patrol_that_dies_and_comes_back(house, console):
    house.start_move_base()
    house.start_patrol()
    console.start()
    page = console.browser()
    page.see("On guard. All is quiet.")
    house.patrol.kill()
    page.see("The guard does not answer.")
    page.press("Look at all rooms")
    page.see("The guard does not answer")
    house.start_patrol()
    page.see("On guard. All is quiet.", 40.0)
