"""patrol_robot as a process, before a real master, a real action server and real topics; needs the built workspace.

The camera and the detector are the test: it publishes pictures with stamps, and boxes that name them.
"""

import contextlib
import itertools
import json
import mailbox
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from ros_processes import free_port

rospy = pytest.importorskip("rospy", reason="needs ROS: source the workspace first")
HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


def stop(process, sig=signal.SIGINT):
    """End it; with None it was told already."""
    if process.poll() is None:
        if sig is not None:
            process.send_signal(sig)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def wait_until(condition, seconds=30.0, what="the condition"):
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError(f"{what} did not come within {seconds} s")


@contextlib.contextmanager
def patrol_master():
    """A master for the test's own process, on the wall's clock or a simulated one."""
    port = int(os.environ.get("ROSBOT_TEST_PORT", 0)) or free_port()
    os.environ.update(ROS_MASTER_URI=f"http://localhost:{port}", ROS_HOSTNAME="localhost")
    os.environ.update(PYTHONUNBUFFERED="1")  # the tests read the nodes' output while they run
    core = subprocess.Popen(["roscore", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    import rosgraph

    wait_until(rosgraph.is_master_online, 30, "roscore")
    rate = float(
        os.environ.get("ROSBOT_TEST_SIM_RATE", 0)
    )  # simulated time at so many times the wall's, for a run by hand
    rospy.set_param("/use_sim_time", rate > 0)
    rospy.init_node("patrol_test", disable_signals=True)
    threading.Thread(target=run_clock, args=(rate,), daemon=True).start()
    yield port
    rospy.signal_shutdown("done")
    stop(core)


def run_clock(rate):
    from rosgraph_msgs.msg import Clock

    began = time.monotonic()
    clock = rospy.Publisher("/clock", Clock, queue_size=1) if rate else None
    while clock and not rospy.is_shutdown():
        clock.publish(Clock(clock=rospy.Time.from_sec(5.0 + rate * (time.monotonic() - began))))
        time.sleep(0.01 / rate)


class House:
    """Processes and topics around the node under test."""

    def __init__(self, folder):
        from darknet_ros_msgs.msg import BoundingBoxes, ObjectCount
        from geometry_msgs.msg import Twist
        from rosbot_patrol.msg import Alert, EspTrigger, PatrolState
        from sensor_msgs.msg import Image

        self.folder = folder
        self.processes = []
        self.states, self.alerts, self.verdicts, self.twists = [], [], [], []
        self.person, self.detecting, self.running = False, True, True
        self.boxes = rospy.Publisher("/darknet_ros/bounding_boxes", BoundingBoxes, queue_size=1)
        self.count = rospy.Publisher("/darknet_ros/found_object", ObjectCount, queue_size=1)
        self.image = rospy.Publisher("/camera/rgb/image_raw", Image, queue_size=1)
        self.trigger = rospy.Publisher("/motion_trigger", EspTrigger, queue_size=10)
        self.ends = [
            rospy.Subscriber("/patrol/state", PatrolState, self.states.append),
            rospy.Subscriber("/patrol/alerts", Alert, self._on_alert),
            rospy.Subscriber("/cmd_vel", Twist, lambda m: self.twists.append(m.angular.z)),
        ]
        self.thread = threading.Thread(target=self._camera, daemon=True)
        self.thread.start()

    def _on_alert(self, message):
        (self.verdicts if message.kind == "verdict" else self.alerts).append(message)

    def _camera(self):
        from darknet_ros_msgs.msg import BoundingBox, BoundingBoxes, ObjectCount
        from sensor_msgs.msg import Image

        for shade in itertools.cycle(range(60, 200)):  # neither black nor twice the same: a camera that sees
            if not self.running:
                return
            image = Image(width=64, height=48, encoding="rgb8", step=192, data=bytes([shade]) * (64 * 48 * 3))
            image.header.stamp = rospy.Time.now()
            self.image.publish(image)
            if self.detecting:
                self.count.publish(ObjectCount(count=1 if self.person else 0))
                if self.person:
                    box = BoundingBox(probability=0.9, xmin=10, ymin=5, xmax=30, ymax=28, Class="person")
                    self.boxes.publish(BoundingBoxes(image_header=image.header, bounding_boxes=[box]))
            time.sleep(0.1)

    def start_move_base(self, **params):
        self.move_base = self._start([sys.executable, str(HERE / "move_base_like.py")], params)

    def start_patrol(self, wait=True, inside=(), **params):
        values = {
            "path_to_params": str(ROOT / "params" / "room_points.yaml"),
            "network": "house",  # the boxes of this test are as sure as its own
            "state_dir": str(self.folder / "state"),
            "maildir": str(self.folder / "mail"),
            "transport": "maildir",
            "mail_interval": 0,
            "spin_speed": 2.5,
            "spin_deceleration": 3.0,
            "detector_wait": 1.5,
            "detector_timeout": 1.0,
            "linger": 0.3,
            "retry_delay": 0.2,
            "evidence_after": 3.0,  # a record waits for its pictures
            **params,
        }
        self.states.clear()
        command = [*inside, "rosrun", "rosbot_patrol", "patrol_robot", "__name:=patrolling_node"]
        self.patrol = self._start(command, values)
        if wait:
            try:
                wait_until(lambda: self.states and self.states[-1].state == "idle", 60, "on guard")
            except AssertionError as err:
                said = [s.why for s in self.states]
                raise AssertionError(f"{err}; it said {said}; its log: {self.log(self.patrol)[-3000:]}") from err

    def _start(self, command, params):
        log = (self.folder / f"log{len(self.processes)}").open("wb")
        arguments = [f"_{key}:={json.dumps(value)}" for key, value in params.items()]
        process = subprocess.Popen([*command, *arguments], stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
        self.processes.append(process)
        return process

    def log(self, process):
        return (self.folder / f"log{self.processes.index(process)}").read_text(errors="replace")

    def send(self, room, move=True):
        from rosbot_patrol.msg import EspTrigger

        wait_until(lambda: self.trigger.get_num_connections() > 0, 20, "the node's subscription")
        self.trigger.publish(EspTrigger(id=room, move=move))

    def wait_for_mission(self, count=1, seconds=60):
        def ended():
            names = [s.state for s in self.states]
            return sum(a != "idle" and b == "idle" and a != "starting" for a, b in itertools.pairwise(names)) >= count

        wait_until(ended, seconds, f"the end of mission {count}")
        return self.states[-1]

    def phases(self):
        names = [s.state for s in self.states]
        return [n for i, n in enumerate(names) if i == 0 or names[i - 1] != n]

    def incident(self, incident_id):
        from rosbot_patrol.alerts.records.store import IncidentStore
        from rosbot_patrol.alerts.records.verify import verify

        with IncidentStore(self.folder / "state", read_only=True) as store:
            done = verify(store)
            assert done.fits, done.problems
            return store.get(incident_id)

    def mails(self):
        folder = self.folder / "mail"
        return list(mailbox.Maildir(folder, create=False)) if (folder / "cur").exists() else []  # made last

    def close(self):
        for process in reversed(self.processes):  # told one and all, so that their ends take the time of one
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in reversed(self.processes):
            stop(process, None)
        self.running = False
        self.thread.join()
        for end in [*self.ends, self.boxes, self.count, self.image, self.trigger]:
            end.unregister()
        for name in ("/patrolling_node", "/move_base"):
            if rospy.has_param(name):
                rospy.delete_param(name)
