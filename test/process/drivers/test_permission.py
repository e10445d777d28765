"""A serial device that this user may not open, told by the lidar's driver and by the bridge. Root drops its rights."""

import os
import subprocess
import sys
from pathlib import Path

SRC = Path(__file__).parents[3] / "src"
NOBODY = 65534
SCRIPT = f"""
import logging, os, pty
from rosbot_patrol.drivers.rplidar.opening import ChannelParams, open_channel
from rosbot_patrol.errors import DeviceError
from rosbot_patrol.rosserial.server.policy import TRUSTED
from rosbot_patrol.rosserial.server.server import SerialServer
logging.basicConfig(format="%(message)s")
class Handler:
    def tick(self): pass
    def flush(self): pass
_, slave = pty.openpty()
path = os.ttyname(slave)
os.chmod(path, 0)
os.environ["USER"] = "guard"
if os.getuid() == 0:
    os.setgroups([]); os.setgid({NOBODY}); os.setuid({NOBODY})
try:
    open_channel(ChannelParams(serial_port=path))
except DeviceError as err:
    print(err)
server = SerialServer(Handler(), TRUSTED)
server.attach(path, 57600)
server.poll(0.0)
"""


def test_a_port_without_permission_is_explained():
    environment = dict(os.environ, PYTHONPATH=f"{SRC}:{os.environ.get('PYTHONPATH', '')}")
    ended = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, timeout=60)
    what = "may not be opened by this user: sudo adduser guard dialout, then log in again"
    assert what in ended.stdout, ended.stderr
    assert f"{what}; trying again every 3 s" in ended.stderr
