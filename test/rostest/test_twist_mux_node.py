"""twist_mux with the collision guard, and teleop in a terminal, before a real master; needs the built workspace."""

import math
import os
import pty
import signal
import subprocess
import termios
import time
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from ros_processes import PATIENCE, Process, wait_for

CONFIG = Path(__file__).resolve().parents[2] / "config" / "twist_mux.yaml"
TWIST, BOOL = "geometry_msgs/Twist", "std_msgs/Bool"


@pytest.fixture
def base(ros):
    """The probe in place of the base."""
    subprocess.run(["rosparam", "delete", "/twist_mux"], env=ros.env, stderr=subprocess.DEVNULL)  # of the test before
    subprocess.run(["rosparam", "load", str(CONFIG), "/twist_mux"], env=ros.env, check=True)
    probe = ros.probe()
    probe.tell(subscribe=["/cmd_vel", TWIST], advertise=["/e_stop", BOOL])
    for name in ("teleop", "patrol", "move_base"):
        probe.tell(advertise=[f"/cmd_vel/{name}", TWIST])
    return probe


def speeds(base):
    return [float(said["linear"].split("x: ")[1].split()[0]) for said in base.heard(topic="/cmd_vel")]


def drive(base, name, speed, until, seconds=8.0):
    """Command a speed at 20 Hz until the base hears another one."""

    def done():
        base.tell(publish=[f"/cmd_vel/{name}", {"linear": {"x": speed}}])
        return speeds(base)[-1:] == [until]

    wait_for(done, seconds, f"{until} m/s")


def test_priorities_time_out_and_lock(ros, base):
    mux = ros.node("twist_mux", "_guard:=false", "cmd_vel_out:=/cmd_vel")
    drive(base, "move_base", 0.5, 0.5)
    drive(base, "teleop", -0.2, -0.2)
    for _ in range(3):
        base.tell(publish=["/cmd_vel/move_base", {"linear": {"x": 0.5}}])
        assert speeds(base)[-1] == -0.2
    wait_for(lambda: speeds(base)[-1] == 0.0, 3.0, "a zero after silence")
    base.tell(publish=["/e_stop", {"data": True}])
    mux.says("the base is stopped: e_stop is set")
    base.tell(publish=["/cmd_vel/teleop", {"linear": {"x": 0.5}}])
    assert speeds(base)[-1] == 0.0


def test_who_dies_while_it_drives_is_silent_at_once(ros, base):
    topics = "[{name: move_base, topic: /cmd_vel/dying, priority: 1, timeout: 60.0}]"
    subprocess.run(["rosparam", "set", "/twist_mux/topics", topics], env=ros.env, check=True)
    mux = ros.node("twist_mux", "_guard:=false", "cmd_vel_out:=/cmd_vel")
    dying = Process(["rostopic", "pub", "-r", "20", "/cmd_vel/dying", TWIST, "{linear: {x: 0.5}}"], ros.env)
    wait_for(lambda: speeds(base)[-3:] == [0.5] * 3, 10.0, "0.5 m/s")
    dying.stop(signal.SIGKILL)
    wait_for(lambda: speeds(base)[-1] == 0.0, 2.0, "a zero")
    mux.says("move_base has gone while it drove")


def test_without_a_scan_it_creeps_and_says_so(ros, base):
    mux = ros.node("twist_mux", "cmd_vel_out:=/cmd_vel")
    drive(base, "patrol", 0.5, 0.1)
    mux.says("patrol is held back: no scan yet")


UPRIGHT, UPSIDE_DOWN, PITCHED_OVER = (0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)
ON_ITS_SIDE = (0.5**0.5, 0.0, 0.0, 0.5**0.5)
POST = math.radians(58.0)  # direction of the post on the left of the robot
BEAMS = 360


def stamp_now():
    seconds = time.time()
    return {"secs": int(seconds), "nsecs": int(seconds % 1.0 * 1e9)}


def ranges_of(post):
    """A post 0.245 m away in a direction of the laser, and 5 m else."""
    angles = [-math.pi + math.tau / BEAMS * i for i in range(BEAMS)]
    return [0.245 if math.cos(angle - post) > 0.99 else 5.0 for angle in angles]


class Lidar:
    """Tells where the laser is and what it measures."""

    def __init__(self, base, quaternion, **changes):
        self._base, self._quaternion, self._changes = base, dict(zip("xyzw", quaternion, strict=True)), changes
        base.tell(
            subscribe=["/diagnostics", "diagnostic_msgs/DiagnosticArray"], advertise=["/tf", "tf2_msgs/TFMessage"]
        )
        base.tell(advertise=["/scan", "sensor_msgs/LaserScan"])

    def scan(self):
        place = {"translation": {"x": 0.0, "y": 0.0, "z": 0.2}, "rotation": self._quaternion}
        header = {"stamp": stamp_now(), "frame_id": "base_link"}
        edge = {"header": header, "child_frame_id": "laser", "transform": place}
        values = {
            "header": {"stamp": stamp_now(), "frame_id": "laser"},
            "angle_min": -math.pi,
            "angle_max": math.pi - math.tau / BEAMS,
            "angle_increment": math.tau / BEAMS,
            "range_min": 0.1,
            "range_max": 12.0,
        }
        self._base.tell(publish=["/tf", {"transforms": [edge]}])
        self._base.tell(publish=["/scan", {**values, **self._changes}])

    def told(self):
        """What /diagnostics last said, level and all."""
        return ([said["status"] for said in self._base.heard(topic="/diagnostics")] or [""])[-1]


def turned(base, lidar, speed):
    """The turn [rad/s] that comes of a wish, after a second of scans."""
    for _ in range(20):
        lidar.scan()
        base.tell(publish=["/cmd_vel/patrol", {"angular": {"z": speed}}])
        time.sleep(0.05)
    return float(base.heard(topic="/cmd_vel")[-1]["angular"].split("z: ")[1].split()[0])


@pytest.mark.parametrize(
    ("quaternion", "post"),
    [(UPRIGHT, POST), (UPSIDE_DOWN, -POST), (PITCHED_OVER, math.pi - POST)],
    ids=["upright", "roll pi", "pitch pi"],
)
def test_a_post_on_the_left_slows_the_turn_to_it_however_the_laser_hangs(ros, base, quaternion, post):
    subprocess.run(["rosparam", "set", "/twist_mux/collision_guard/half_length", "0.25"], env=ros.env, check=True)
    ros.node("twist_mux", "cmd_vel_out:=/cmd_vel")
    lidar = Lidar(base, quaternion, ranges=ranges_of(post))
    assert 0.0 < turned(base, lidar, 1.5) < 1.4
    assert turned(base, lidar, -1.5) == pytest.approx(-1.5)


@pytest.mark.parametrize(
    ("quaternion", "changes", "named"),
    [
        (UPRIGHT, {"ranges": [0.0] * BEAMS}, "say nothing"),
        (UPSIDE_DOWN, {"ranges": [170.0] * BEAMS}, "millimetres"),
        (UPRIGHT, {"ranges": [5.0] * BEAMS, "header": {"frame_id": "laser"}}, "its stamp is 0"),
        (ON_ITS_SIDE, {"ranges": [5.0] * BEAMS}, "the laser 'laser' is tilted by 90 deg in 'base_link'"),
    ],
    ids=["zeros", "millimetres", "no stamp", "tilted"],
)
def test_scans_that_are_none_leave_a_crawl_and_are_named(ros, base, quaternion, changes, named):
    mux = ros.node("twist_mux", "cmd_vel_out:=/cmd_vel")
    lidar = Lidar(base, quaternion, **changes)
    assert turned(base, lidar, 1.5) == pytest.approx(0.4)
    mux.says(named)
    words = (named, "level: 1", "patrol drives; no usable scan yet")

    def is_told():  # while somebody commands
        base.tell(publish=["/cmd_vel/patrol", {"angular": {"z": 1.5}}])
        return all(word in lidar.told() for word in words)

    wait_for(is_told, 5.0, "a warning on /diagnostics")
    assert sum(named in line and "lets the base creep only" in line for line in mux.output.splitlines()) == 1


def test_two_sources_of_one_priority_are_one_sentence(ros, base):
    subprocess.run(
        [
            "rosparam",
            "set",
            "/twist_mux/topics",
            "[{name: a, topic: a, priority: 1}, {name: b, topic: b, priority: 1}]",
        ],
        env=ros.env,
        check=True,
    )
    mux = ros.node("twist_mux")
    mux.says("topics/priority: 1 is given twice")
    assert mux.popen.wait(PATIENCE) == 1


def test_teleop_without_a_terminal_waits(ros):
    teleop = ros.node("teleop_twist_keyboard.py")
    teleop.says("no terminal here")
    assert teleop.popen.poll() is None
    assert teleop.stop() == 0


def in_terminal(ros, *command):
    """A program whose own terminal it is, and the keyboard's end of that."""
    keyboard, terminal = pty.openpty()
    process = Process(["setsid", "--ctty", "--wait", *command], ros.env, stdin=terminal)
    ros.processes.append(process)
    os.close(terminal)
    return process, keyboard


def test_teleop_under_roslaunch_leaves_the_terminal_to_it(ros):
    launch, keyboard = in_terminal(ros, "roslaunch", "--skip-log-check", "rosbot_patrol", "teleop.launch")
    launch.says("no terminal here", 20.0)
    assert termios.tcgetattr(keyboard)[3] & termios.ISIG
    os.write(keyboard, b"\x03")
    launch.popen.wait(15.0)
    os.close(keyboard)


def test_teleop_in_the_background_waits_for_the_front(ros):
    start = " ".join(ros.command("teleop_twist_keyboard.py"))
    shell, keyboard = in_terminal(ros, "bash", "-ic", f"{start} & read -r; fg; true")
    shell.says("no terminal here", 20.0)
    os.write(keyboard, b"\n")
    shell.says("Waiting for subscriber")
    os.write(keyboard, b"\x03")
    shell.popen.wait(5.0)
    os.close(keyboard)


def test_teleop_in_a_terminal(ros):
    probe = ros.probe()
    probe.tell(subscribe=["/cmd_vel", TWIST])
    teleop, keyboard = in_terminal(ros, *ros.command("teleop_twist_keyboard.py"))
    teleop.says("currently:")
    for key, speed in ((b"i", 0.5), (b",", -0.5), (b"k", 0.0), (b"w", 0.0), (b"i", 0.55)):
        os.write(keyboard, key)
        wait_for(lambda speed=speed: speeds(probe)[-1:] == [pytest.approx(speed)], 3.0, f"{speed} m/s")
    os.write(keyboard, b"\x03")
    assert teleop.popen.wait(5.0) == 0
    wait_for(lambda: speeds(probe)[-1] == 0.0, 3.0, "a zero at the end")
    os.close(keyboard)
