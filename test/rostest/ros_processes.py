"""A master, nodes and a probe as processes, so that tests in one pytest run may each have a master of their own."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
import xmlrpc.client
from pathlib import Path

from rosbot_patrol.ros.campaign.ports import free_port

HERE = Path(__file__).resolve().parent

# A shell's background job starts with SIGINT ignored, and so would every node: each would have to be killed.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


PATIENCE = 30.0  # [s] what is only waited for may take that long on a busy machine; it is seen at once where it comes


def wait_for(condition, seconds=PATIENCE, what="the condition"):
    until = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < until, f"{what} did not come within {seconds} s"
        time.sleep(0.02)
    return found


class Process:
    """A program with its output collected line by line."""

    def __init__(self, command, env, stdin=None):
        self.lines = []
        self.popen = subprocess.Popen(
            command, env=env, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.popen.stdout:
            self.lines.append(line.rstrip())

    @property
    def output(self):
        """What it has said so far; all of it once it has ended, unless a child of its own holds the pipe."""
        if self.popen.poll() is not None:
            self.reader.join(0.5)
        return "\n".join(self.lines)

    def says(self, text, seconds=PATIENCE):
        wait_for(lambda: text in self.output or self.popen.poll() is not None, seconds, f"'{text}'")
        time.sleep(0.1)
        assert text in self.output, self.output

    def stop(self, sig=signal.SIGINT):
        """End it; with None it was told already."""
        if self.popen.poll() is None:
            if sig is not None:
                self.popen.send_signal(sig)
            try:
                self.popen.wait(8.0)
            except subprocess.TimeoutExpired:
                print("killed, as it did not stop:", self.popen.args, self.output[-3000:])
                self.popen.kill()
                self.popen.wait()
        return self.popen.returncode


class Ros:
    """A roscore on a port of its own, and what runs on it."""

    def __init__(self):
        port = int(os.environ.get("ROSBOT_TEST_PORT", 0)) or free_port()
        self.env = dict(os.environ, ROS_MASTER_URI=f"http://localhost:{port}", ROS_HOSTNAME="localhost")
        self.env.update(PYTHONUNBUFFERED="1")
        self.core = Process(["roscore", "-p", str(port)], self.env)
        self.core.says("started core service", 30.0)
        self.processes = []

    def command(self, program):
        """How to start a program of ours as a process of its own, without rosrun."""
        for folder in self.env["CMAKE_PREFIX_PATH"].split(":"):
            path = Path(folder, "lib", "rosbot_patrol", program)
            if path.exists():
                return [sys.executable, str(path)]
        raise AssertionError(f"{program} is not built")

    def node(self, program, *arguments, stdin=subprocess.DEVNULL):
        process = Process([*self.command(program), *arguments], self.env, stdin=stdin)
        self.processes.append(process)
        return process

    def probe(self):
        probe = Probe(self.env)
        self.processes.append(probe.process)
        return probe

    def script(self, text):
        """A program of the test's own, which says what it hears as a probe does."""
        process = Process([sys.executable, "-c", text], self.env, stdin=subprocess.PIPE)
        self.processes.append(process)
        return Teller(process)

    def set_param(self, name, value):
        """On the parameter server, without a process of its own."""
        xmlrpc.client.ServerProxy(self.env["ROS_MASTER_URI"]).setParam("/test", name, value)

    def forget(self, name):
        """Delete a parameter, or a tree of them, that may be there."""
        xmlrpc.client.ServerProxy(self.env["ROS_MASTER_URI"]).deleteParam("/test", name)

    def stop_nodes(self):
        for process in reversed(self.processes):  # told one and all, so that their ends take the time of one
            if process.popen.poll() is None:
                process.popen.send_signal(signal.SIGINT)
        for process in reversed(self.processes):
            process.stop(None)
        self.processes.clear()

    def stop(self):
        self.stop_nodes()
        self.core.stop()


class Peer:
    """A program of the test's own that does what it is told and answers in JSON; see `room_peer.serve`."""

    def __init__(self, ros, script):
        self.process = Process([sys.executable, str(HERE / script)], ros.env, stdin=subprocess.PIPE)
        ros.processes.append(self.process)
        self.answers = 0
        self.process.says("ready", 20.0)

    def do(self, what, **options):
        """Let it do something and hear what the node said meanwhile."""
        self.process.popen.stdin.write(json.dumps({"do": what, **options}) + "\n")
        self.process.popen.stdin.flush()
        self.answers += 1
        lines = wait_for(self._answered, 20.0, "the peer's answer")
        return json.loads(lines[self.answers])

    def _answered(self):
        lines = [line for line in self.process.lines if line.startswith("{")]
        return lines if len(lines) > self.answers else None


class Teller:
    """A process that says what it hears in lines of JSON, `{"ready": true}` first."""

    def __init__(self, process):
        self.process = process
        self.expect(lambda said: said.get("ready"), 2.0 * PATIENCE)

    def heard(self, **fields):
        """Everything said so far that has these fields."""
        said = [json.loads(line) for line in list(self.process.lines) if line.startswith("{")]
        return [each for each in said if all(each.get(key) == value for key, value in fields.items())]

    def expect(self, condition, seconds=PATIENCE):
        """The first thing said, from now or before, that meets a condition."""
        return wait_for(lambda: next((s for s in self.heard() if condition(s)), None), seconds, "what the probe awaits")


class Probe(Teller):
    """topic_probe.py at the other end of two pipes."""

    def __init__(self, env):
        super().__init__(Process([sys.executable, str(HERE / "topic_probe.py")], env, stdin=subprocess.PIPE))

    def tell(self, **command):
        line = json.dumps(command)
        self.process.popen.stdin.write(line + "\n")
        self.process.popen.stdin.flush()
        self.expect(lambda said: said.get("done") == line)
