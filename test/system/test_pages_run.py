"""Each page's commands, typed in the page's order in a fresh home, against the house that the page's own launch starts.

A launch runs on until the next one or the end of the page. Programs that run until Ctrl-C are interrupted before the
next command, but for `record`, which keeps the motion that a trigger after it makes. Pages without a launch share the
default one. Commands behind `<!-- long -->` run by `scripts/test --long`.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rosbot_patrol.ros.campaign.house", reason="the workspace is not on the path: `. scripts/env`")
import rosgraph
import rospy
from command_check import ROOT, launch_arguments, launch_file
from geometry_msgs.msg import PointStamped
from page_commands import Command, commands_of
from page_list import PAGES
from rosbot_patrol.msg import PatrolState

from rosbot_patrol.patrol.house.rooms import load_rooms
from rosbot_patrol.ros.campaign.house import House, end_group
from rosbot_patrol.ros.campaign.ports import free_port

pytestmark = [pytest.mark.system, pytest.mark.slow]

RUNS_ON = re.compile(
    r"rosrun rosbot_patrol (record|mark_rooms|serial_node\.py)|rosbag record|rostopic echo (?!-n)"
    r"|rostopic pub (?!-1)|rosrun teleop_twist_keyboard|scripts/patrol demo:=false"
)
QUIET_ARGUMENTS = {
    "transport": "maildir",
    "rviz": "false",
    "gui": "false",
}  # no screen or mail here
DEFAULT_LAUNCH = "roslaunch rosbot_patrol rosbot_patrol.launch"
EXPLORED = re.compile(r"save_map:=\$PWD/(\w+)")
REFUSED = re.compile(r"^(success|accepted): False$", re.MULTILINE)


class Reader:
    """Who sits before the page and types.

    Args:
        folder: a fresh one: home, and links to the repository's entries as the folder to type in.
        rate: real-time factor of the houses; 0: as fast as possible.
    """

    def __init__(self, folder: Path, rate: float) -> None:
        self._quiet = {**QUIET_ARGUMENTS, "rate": str(rate)}
        self._home = folder / "Jörg Müller"  # names of homes hold such letters
        self._desk = folder / "rosbot_patrol"
        self._home.mkdir()
        self._desk.mkdir()
        for entry in ROOT.iterdir():
            if not entry.name.startswith(".") or entry.name == ".ws":
                (self._desk / entry.name).symlink_to(entry)
        cache = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))  # kernels: compiled by scripts/bootstrap
        path = f"{ROOT}/.ws/devel/bin:/usr/sbin:/usr/bin:/sbin:/bin"  # as on a fresh Debian: its python3 is the first
        self._environment = {**os.environ, "HOME": str(self._home), "XDG_CACHE_HOME": cache, "PATH": path}
        for name in ("ROS_HOME", "ROS_LOG_DIR", "DISPLAY", "ROSBOT_VER"):
            self._environment.pop(name, None)
        self._house: House | None = None
        self._running: list[tuple[Command, subprocess.Popen[bytes], Path]] = []

    def skip(self, command: Command) -> None:
        """Lay the map that an exploration would have made, for the commands after it."""
        for name in EXPLORED.findall(command.typed):
            shutil.copy(ROOT / "maps" / "rosbot_map.pgm", self._desk / f"{name}.pgm")
            text = (ROOT / "maps" / "rosbot_map.yaml").read_text(encoding="utf-8")
            (self._desk / f"{name}.yaml").write_text(text.replace("rosbot_map.pgm", f"{name}.pgm"))

    def type(self, command: Command) -> None:
        """Run one command as typed; raises AssertionError where it fails."""
        begin = time.monotonic()
        if command.wait:
            self._come_home()
        if command.typed.startswith("scripts/"):
            self.leave()  # it starts a house of its own, which wants the same ports
        if command.words[0] == "roslaunch":
            self._launch(command)
        elif RUNS_ON.match(command.typed):
            self._begin(command)
        else:
            if not command.typed.startswith("rostopic pub"):
                self._interrupt()
            self._do(command)
        print(f"{time.monotonic() - begin:5.1f} s  {command.where}  {command.typed}")

    def launch_default(self) -> None:
        """A house, for a page that takes it for granted."""
        self._launch(Command(page="", line=0, text=DEFAULT_LAUNCH, mode="run"))

    def leave(self) -> None:
        """End all that runs."""
        try:
            self._interrupt()
        finally:
            if self._house is not None:
                self._house.stop()
                self._house = None

    def _launch(self, command: Command) -> None:
        self.leave()
        known = launch_arguments(launch_file(command.words))
        quiet = " ".join(f"{name}:={value}" for name, value in self._quiet.items() if name in known)
        words = ["bash", "-c", f"cd '{self._desk}' && exec {command.typed} {quiet}"]
        self._house = House(self._home, plain=True, before=words)
        self._house.start(self._environment)
        has_patrol = "path_to_params" in known
        if has_patrol:
            self._house.wait_ready(90.0)
        else:
            self._house.wait(_is_settled, 60.0, f"the nodes of {command.where}")
        for name in EXPLORED.findall(command.typed):
            saved = self._desk / f"{name}.yaml"
            saved.unlink(missing_ok=True)
            self._house.wait(saved.exists, 900.0, f"the map of {command.where}")
        assert "Traceback" not in self._house.log_end(2000), f"{command.where}: {self._house.log_end()}"

    def _come_home(self) -> None:
        house = self._house
        assert house is not None
        house.wait(
            lambda: house.state is not None and house.state.state != PatrolState.IDLE, 30.0, "the robot setting off"
        )
        house.wait(
            lambda: house.state is not None and house.state.state == PatrolState.IDLE, 400.0, "the robot at home"
        )

    def _do(self, command: Command) -> None:
        text = command.text
        if re.search(r"\bID\b", command.typed):
            text = command.typed.replace("ID", self._newest_incident())
        if command.words[:2] == ["rosservice", "call"]:  # a node may be there some time before its services
            name = f"/{command.words[2].lstrip('/')}"
            _wait_for(lambda: name in _services(), f"the service of {command.where}", 60.0)
        done = subprocess.run(
            ["bash", "-c", text],
            cwd=self._desk,
            env=self._environment_of(command),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=900 if command.mode == "long" else 120,
            check=False,
        )
        said = done.stdout + done.stderr
        assert done.returncode == 0, f"{command.where}: exit status {done.returncode}: {command.text}\n{said}"
        assert not REFUSED.search(said), f"{command.where}: {command.text}\n{said}"
        assert "Traceback" not in said, f"{command.where}: {command.text}\n{said}"

    def _environment_of(self, command: Command) -> dict[str, str]:
        if not command.typed.startswith("scripts/"):
            return self._environment
        # it starts a house of its own
        return {**self._environment, "ROS_MASTER_URI": f"http://localhost:{free_port()}"}

    def _newest_incident(self) -> str:
        listed = ["rosrun", "rosbot_patrol", "incidents", "list", "--json"]
        told = subprocess.run(listed, env=self._environment, capture_output=True, check=True, timeout=60).stdout
        newest = json.loads(told.splitlines()[0])
        return str(newest["id"])

    def _begin(self, command: Command) -> None:
        before = _nodes()
        output = self._home / f"output{len(list(self._home.glob('output*')))}"
        with output.open("wb") as out:
            process = subprocess.Popen(
                ["bash", "-c", f"exec {command.typed}"],
                cwd=self._desk,
                env={**self._environment_of(command), "PYTHONUNBUFFERED": "1"},
                stdin=subprocess.PIPE,
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_heed_ctrl_c,
            )
        self._running.append((command, process, output))
        if "mark_rooms" in command.typed:
            self._click(process, output)
        elif command.typed.startswith("scripts/"):
            _wait_for(lambda: "On guard" in output.read_text() or process.poll() is not None, "its house", 120.0)
        else:
            # rosrun asks catkin_find four times, which takes long while two houses take all of both cores
            is_there = f"the node of {command.where}"
            _wait_for(lambda: bool(_nodes() - before) or process.poll() is not None, is_there, 120.0)
            time.sleep(1.0)  # its subscriptions
        assert process.poll() is None, f"{command.where}: it ended by itself: {command.text}\n{output.read_text()}"

    def _click(self, process: subprocess.Popen[bytes], output: Path) -> None:
        """The hand that clicks in rviz and types names: the points of our own house."""
        publisher = rospy.Publisher("/clicked_point", PointStamped, queue_size=1)
        assert process.stdin is not None
        _wait_for(lambda: publisher.get_num_connections() > 0, "mark_rooms, that hears clicks")
        time.sleep(1.0)  # it hears the map, too
        for number, room in enumerate(load_rooms(ROOT / "params" / "room_points.yaml")):
            click = PointStamped()
            click.header.frame_id = "map"
            click.point.x, click.point.y = room.pose.x, room.pose.y
            publisher.publish(click)
            _wait_for(lambda n=number: output.read_text().count("Name of") > n, f"the question for a name: {output}")
            process.stdin.write(f"place {number}\n".encode())
            process.stdin.flush()
            _wait_for(lambda n=number: f"room {n} (place {n}) at" in output.read_text(), f"room {number} in the file")
        publisher.unregister()

    def _interrupt(self) -> None:
        """Ctrl-C for each program that runs on."""
        while self._running:
            command, process, output = self._running.pop()
            by_itself = process.poll() is not None
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(30.0)
            status, said = process.poll(), output.read_text()
            end_group(process)
            assert not by_itself, f"{command.where}: it ended by itself: {command.text}\n{said}"
            assert status in (0, 130, -signal.SIGINT), f"{command.where}: {status} after Ctrl-C: {command.text}\n{said}"
            assert "Traceback" not in said, f"{command.where}: {command.text}\n{said}"


def _heed_ctrl_c() -> None:
    """A shell in the background starts its programs with SIGINT ignored, and they hand that on."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _is_settled() -> bool:
    """Whether some node more than ours and rosout's is there, and all that the launch brought for 3 s."""
    before = _nodes()
    time.sleep(3.0)
    return len(before) > 0 and before == _nodes()


def _nodes() -> set[str]:
    published, subscribed, services = rosgraph.Master("/pages").getSystemState()
    names = {node for topics in (published, subscribed, services) for _, nodes in topics for node in nodes}
    return {name for name in names if "house_watch" not in name and name != "/rosout"}


def _services() -> set[str]:
    return {name for name, _ in rosgraph.Master("/pages").getSystemState()[2]}


def _wait_for(condition: object, what: str, timeout: float = 30.0) -> None:
    deadline = time.monotonic() + timeout
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < deadline, f"after {timeout:.0f} s still no: {what}"
        time.sleep(0.1)


@pytest.fixture
def reader(master: object, folder: Path, request: pytest.FixtureRequest) -> Iterator[Reader]:
    is_long = request.node.get_closest_marker("long") is not None  # it waits for missions
    reading = Reader(folder, rate=0.0 if is_long else 1.0)
    yield reading
    reading.leave()


def _commands(page: str) -> list[Command]:
    return commands_of(page, (ROOT / page).read_text(encoding="utf-8"))


def _groups(*modes: str) -> list[Any]:
    """Pages that hold a command of the last of the modes: each by itself, but for those without a launch."""
    pages = [page for page in PAGES if any(command.mode == modes[-1] for command in _commands(page))]
    alone = [page for page in pages if _launches(page, *modes)]
    guests = [page for page in pages if page not in alone]
    shared = [pytest.param(guests, id="without a launch")] if guests else []
    return [pytest.param([page], id=page) for page in alone] + shared


def _launches(page: str, *modes: str) -> bool:
    return any(command.words[0] == "roslaunch" and command.mode in modes for command in _commands(page))


def _read(reader: Reader, pages: list[str], *modes: str) -> None:
    if not _launches(pages[0], *modes):
        reader.launch_default()
    for command in (command for page in pages for command in _commands(page)):
        if command.mode in modes:
            reader.type(command)
        else:
            reader.skip(command)
    if pages == ["docs/own_house.md"]:
        assert Path(rospy.get_param("/patrolling_node/path_to_params")).name == "my_rooms.yaml"  # not the tutorial's
    reader.leave()


@pytest.mark.parametrize("pages", _groups("run"))
def test_the_commands_of_a_page_run(reader: Reader, pages: list[str]) -> None:
    _read(reader, pages, "run")


@pytest.mark.long
@pytest.mark.parametrize("pages", _groups("run", "long"))
def test_the_long_commands_of_a_page_run(reader: Reader, pages: list[str]) -> None:
    _read(reader, pages, "run", "long")
