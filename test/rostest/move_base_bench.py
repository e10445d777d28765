"""move_base with the tuned profile before light_base.py and action_client.py, for the tests of its outside."""

import json
import subprocess
import sys
import time
from pathlib import Path

import yaml
from ros_processes import PATIENCE, Process, Teller, wait_for

HERE = Path(__file__).resolve().parent
TUNED = HERE.parents[1] / "config" / "tuned"


def parameters():
    """The tuned profile, less patient, turning quickly, and strict about goals."""
    tree = {}
    for name in ("move_base", "trajectory_planner", "local_costmap_params", "global_costmap_params"):
        tree |= yaml.safe_load((TUNED / f"{name}.yaml").read_text())
    common = yaml.safe_load((TUNED / "costmap_common_params.yaml").read_text())
    for costmap in ("global_costmap", "local_costmap"):
        tree[costmap] = common | tree[costmap]
    quick = {"max_rotational_vel": 6.0, "acc_lim_th": 20.0}
    return tree | {
        "planner_patience": 0.6,
        "controller_frequency": 20.0,
        "rotate_recovery": quick,
        "NavfnROS": {"allow_unknown": False, "default_tolerance": 0.0},
    }


class Client(Teller):
    """action_client.py at the other end of two pipes."""

    def __init__(self, ros):
        self._count = 0
        super().__init__(Process([sys.executable, str(HERE / "action_client.py")], ros.env, stdin=subprocess.PIPE))
        ros.processes.append(self.process)

    def since(self, t):
        """What was said after a time, as it sees it."""
        return [said for said in self.heard() if said["t"] > t]

    def tells(self, **command):
        """Tell, and return when it did so."""
        self._count += 1
        self.process.popen.stdin.write(json.dumps(command | {"count": self._count}) + "\n")
        self.process.popen.stdin.flush()
        return self.expect(lambda said: said.get("count") == self._count)["t"]

    def next(self, t, condition, seconds=PATIENCE, what="what comes next"):
        """The first thing said after a time that meets a condition."""
        try:
            return wait_for(lambda: next((s for s in self.since(t) if condition(s)), None), seconds, what)
        except AssertionError as err:
            raise AssertionError(f"{err}; said before and since: {self.heard()[-60:]}") from err

    def speed(self):
        said = [s for s in self.heard() if "v" in s]
        return said[-1]["v"], said[-1]["w"]


def start_move_base(ros, **params):
    """Base, move_base and client; a start takes longer than most tests, so a module has one."""
    ros.processes.append(base := Process([sys.executable, str(HERE / "light_base.py")], ros.env))
    subprocess.run(
        ["rosparam", "load", "-", "/move_base"],
        env=ros.env,
        input=yaml.dump(parameters() | params),
        text=True,
        check=True,
    )
    node = ros.node("move_base")
    client = Client(ros)
    node.says("global_costmap: map of 2000 x 2000 cells", 30.0)
    time.sleep(1.5)  # the first update of the global costmap
    return node, client, base
