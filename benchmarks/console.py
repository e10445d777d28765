#!/usr/bin/env python3
"""The owner's web page: how soon it shows, how soon it tells, what it costs.

    python3 benchmarks/console.py [--json FILE] [--seconds 15] [--no-incidents]

The console runs as a node before a real master. Debian's chromium is the browser, driven by Selenium.

- first_page_s: from the request for the first page until its headline shows, in a browser of a phone's size with an
  empty cache; median of five.
- state_to_page_s: from a message on `/patrol/state` until the open page shows its sentence; median of twenty.
- five_viewers_cpu_percent: share of one core while five clients take the camera's stream; pictures of 640 x 480 and
  50 kB come ten times a second.
- idle_cpu_percent: the same while nobody looks, and the pictures still come. mb: memory after all of that.
- mqtt_order_s: from an order at a real mosquitto until the alarm panel's new state is there; median of twenty.
- seen_to_phone_s: from a notice with a picture that is given to the post until a local server of ntfy's protocol has
  it, with the outbox on the disk between; median of ten.
- incidents_100k_ms: a list of the newest 24 of 100,000 incidents, with pictures and marks; median.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from drivers import jpeg, share_of

ROOT = Path(__file__).resolve().parents[1]
sys.path += [str(ROOT / "test" / "process" / name) for name in ("console", "alerts")]  # broker and server of the tests
PHONE = (390, 844)
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")
HEADLINE = """
const done = arguments[1], wanted = arguments[0];
const look = () => document.body.innerText.includes(wanted) ? done(performance.now()) : setTimeout(look, 5);
look();
"""


def driver():  # type: ignore[no-untyped-def]
    """A browser of a phone's size."""
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    for flag in (*FLAGS, f"--window-size={PHONE[0]},{PHONE[1]}", "--lang=en"):
        options.add_argument(flag)
    options.page_load_strategy = "eager"
    return webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)


@contextmanager
def console(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """The node, and the address of its page."""
    import rospy

    from rosbot_patrol.ros.campaign.house import end_group
    from rosbot_patrol.ros.campaign.ports import free_port

    points = ROOT / "params" / "room_points.yaml"
    program = Path(os.environ["CMAKE_PREFIX_PATH"].split(":")[0]) / "lib" / "rosbot_patrol" / "console"
    arguments = [f"_state_dir:={folder / 'state'}", f"_path_to_params:={points}", f"_port:={free_port()}"]
    process = subprocess.Popen([sys.executable, str(program), *arguments], start_new_session=True)
    try:
        until = time.monotonic() + 40.0
        while not rospy.has_param("/console/url") and time.monotonic() < until:
            time.sleep(0.1)
        yield process, rospy.get_param("/console/url")
    finally:
        end_group(process)


def first_page(url: str) -> float:
    """Time until the headline shows [s]."""
    times = []
    for _ in range(5):
        browser = driver()
        try:
            browser.set_script_timeout(30)
            browser.get(url)
            times.append(float(browser.execute_async_script(HEADLINE, "guard")) / 1e3)
        finally:
            browser.quit()
    return statistics.median(times)


def state_to_page(url: str) -> float:
    """Time from a message to the page [s]."""
    import rospy
    from rosbot_patrol.msg import PatrolState

    publisher = rospy.Publisher("/patrol/state", PatrolState, queue_size=1, latch=True)
    browser, times = driver(), []
    try:
        browser.set_script_timeout(30)
        browser.get(url)
        browser.execute_async_script(HEADLINE, "guard")
        for k in range(21):
            room = f"room number {k}"
            began = time.monotonic()
            publisher.publish(PatrolState(state=PatrolState.DRIVING, room_id=1, room_name=room, origin="trigger"))
            browser.execute_async_script(HEADLINE, room)
            times.append(time.monotonic() - began)
            time.sleep(0.3 + 0.017 * k)
    finally:
        browser.quit()
    return statistics.median(times[1:])


def viewers(url: str, process: subprocess.Popen[bytes], count: int, seconds: float) -> tuple[float, float]:
    """CPU [%] with so many viewers of the camera, and pictures a second for each of them."""
    ended, sizes = threading.Event(), [0] * count

    def watch(k: int) -> None:
        with urllib.request.urlopen(f"{url}/camera.mjpg", timeout=10) as stream:
            while not ended.is_set():
                sizes[k] += len(stream.read1(1 << 16))

    for k in range(count):
        threading.Thread(target=watch, args=(k,), daemon=True).start()
    time.sleep(2.0)
    first = sum(sizes)
    cpu, _ = share_of(process, seconds)
    rate = (sum(sizes) - first) / max(count, 1) / len(jpeg()) / seconds
    ended.set()
    time.sleep(2.0)
    return cpu, rate


def live(folder: Path, seconds: float) -> dict[str, float]:
    """All figures that need the node."""
    import rospy
    from sensor_msgs.msg import CompressedImage
    from std_msgs.msg import Empty

    picture, ended = CompressedImage(format="jpeg", data=jpeg()), threading.Event()
    camera = rospy.Publisher("/rgb_republish/compressed", CompressedImage, queue_size=1)
    alive = rospy.Publisher("/patrol/alive", Empty, queue_size=1)

    def show() -> None:
        while not ended.wait(0.1):
            camera.publish(picture)
            alive.publish(Empty())

    with console(folder) as (process, url):
        threading.Thread(target=show, daemon=True).start()
        figures = {"first_page_s": first_page(url), "state_to_page_s": state_to_page(url)}
        time.sleep(15.0)  # until the pages that were left are forgotten
        figures["idle_cpu_percent"], _ = share_of(process, seconds)
        figures["five_viewers_cpu_percent"], figures["pictures_a_second"] = viewers(url, process, 5, seconds)
        _, figures["mb"] = share_of(process, 0.5)
        ended.set()
    return figures


def mqtt_order(folder: Path) -> float:
    """Time from an order by MQTT to the state [s]."""
    import rospy
    from mosquitto_broker import Listener, Mosquitto
    from rosbot_patrol.msg import Arming
    from rosbot_patrol.srv import Arm, ArmResponse

    from rosbot_patrol.ros.campaign.house import end_group

    arming = rospy.Publisher("/patrol/arming", Arming, queue_size=1, latch=True)
    service = rospy.Service(
        "/patrol/arm", Arm, lambda r: (arming.publish(Arming(mode=r.mode)), ArmResponse(accepted=True))[1]
    )
    broker = Mosquitto(folder)
    listener, times = Listener(broker), []
    program = Path(os.environ["CMAKE_PREFIX_PATH"].split(":")[0]) / "lib" / "rosbot_patrol" / "home_assistant"
    arguments = [f"_mqtt:={broker.settings}", f"_state_dir:={folder / 'state'}"]
    node = subprocess.Popen([sys.executable, str(program), *arguments], start_new_session=True)
    try:
        arming.publish(Arming(mode="armed_away"))
        listener.wait("rosbot_patrol/alarm/state", "armed_away", 40.0)
        for k in range(20):
            order, state = ("ARM_HOME", "armed_home") if k % 2 == 0 else ("ARM_AWAY", "armed_away")
            began = time.monotonic()
            listener.say("rosbot_patrol/alarm/set", json.dumps({"action": order}))
            listener.wait("rosbot_patrol/alarm/state", state)
            times.append(time.monotonic() - began)
            time.sleep(0.2)
    finally:
        end_group(node)
        listener.stop()
        broker.stop()
        service.shutdown()
        arming.unregister()
    return statistics.median(times)


def seen_to_phone(folder: Path) -> float:
    """Time from a notice to the phone's service [s]."""
    from push_server import serving

    from rosbot_patrol.alerts.channels.params import MailParams
    from rosbot_patrol.alerts.outbox.notice import Notice
    from rosbot_patrol.ros.post.owner_post import OwnerPost
    from rosbot_patrol.ros.runtime.diagnostics import Health

    times = []
    with serving() as server:
        address = folder / "address"
        address.write_text(f"ntfy://127.0.0.1:{server.port}/topic\n")
        address.chmod(0o600)
        file = folder / "channels.yaml"
        file.write_text(f"channels:\n  mail:\n    type: apprise\n    url_file: {address}\n    interval: 0\n")
        post = OwnerPost(MailParams(channels=str(file)), folder / "state", Health())
        post.start()
        time.sleep(2.0)
        for k in range(11):
            count, began = len(server.requests), time.monotonic()
            text = {"subject": "Person in hall, 06:00", "text": "Person seen in the hall."}
            post.put(Notice(id=f"n{k}", wall=time.time(), kind="incident", picture=jpeg(), **text))
            while len(server.requests) == count:
                time.sleep(0.002)
            times.append(time.monotonic() - began)
            time.sleep(0.5)
    return statistics.median(times[1:])


def incidents(folder: Path) -> dict[str, float]:
    """Time of a page of the list."""
    from alerts_search import COUNT, fill

    from rosbot_patrol.alerts.records.files import FOLDER
    from rosbot_patrol.alerts.records.query import Query
    from rosbot_patrol.alerts.records.store import IncidentStore
    from rosbot_patrol.console.live.incident_desk import IncidentDesk

    fill(folder / FOLDER, COUNT)
    IncidentStore(folder).close_index()
    desk, times = IncidentDesk(folder, time.time), []
    for query in 7 * (Query(limit=25), Query(limit=25, room=3), Query(limit=25, verdict="confirmed")):
        began = time.perf_counter()
        assert len(desk.find(query)) == 25
        times.append(time.perf_counter() - began)
    return {"incidents_100k_ms": 1e3 * statistics.median(times)}


def main() -> None:
    """Print the table, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--no-incidents", action="store_true", help="leave out the 100,000 incidents")
    options = parser.parse_args()
    from rosbot_patrol.ros.campaign.house import Master

    with tempfile.TemporaryDirectory() as folder:
        master = Master(Path(folder) / "roscore.log")
        try:
            figures = live(Path(folder), options.seconds)
            for name, measure in (("mqtt_order_s", mqtt_order), ("seen_to_phone_s", seen_to_phone)):
                own = Path(folder) / name
                own.mkdir()
                figures[name] = measure(own)
        finally:
            master.stop()
        if not options.no_incidents:
            figures |= incidents(Path(folder) / "many")
    print(f"{os.cpu_count()} cores")
    for name, value in figures.items():
        print(f"{name:26} {value:8.2f}")
    if options.json:
        options.json.write_text(json.dumps({"console": figures}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
