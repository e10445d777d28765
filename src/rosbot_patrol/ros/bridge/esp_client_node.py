"""esp_client: a virtual ESP32 with a motion sensor, to test the bridge; needs no ROS master.

rosrun rosbot_patrol esp_client --id 2 --port 11412 --trigger
"""

from __future__ import annotations

import argparse
import logging
import sys
import time

from rosbot_patrol.errors import ParamError
from rosbot_patrol.rosserial.device.tcp_client import EspClient
from rosbot_patrol.rosserial.protocol.keys import key_of


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="esp_client", description="A virtual motion sensor that speaks rosserial.")
    parser.add_argument("--host", default="localhost", help="where the bridge runs (default: %(default)s)")
    parser.add_argument("--port", type=int, default=11411, help="its TCP port (default: %(default)s)")
    parser.add_argument("--id", type=int, default=1, help="the sensor's id, which is its room (default: %(default)s)")
    parser.add_argument("--key-file", default="", metavar="FILE", help="take the sensor's key from a file of keys")
    parser.add_argument("--insist", action="store_true", help="talk only to a bridge that has the same key")
    parser.add_argument("--trigger", action="store_true", help="report motion once, as soon as connected")
    parser.add_argument("--every", type=float, default=0.0, metavar="S", help="report motion every S seconds")
    parser.add_argument("--duration", type=float, default=0.0, metavar="S", help="end after S seconds (0: Ctrl-C)")
    arguments = parser.parse_args([a for a in sys.argv[1:] if not a.startswith("__") and ":=" not in a])
    if not 0 <= arguments.id <= 255:
        parser.error(f"--id {arguments.id}: expected 0 to 255")
    if arguments.insist and not arguments.key_file:
        parser.error("--insist needs a --key-file")
    return arguments


def _play(client: EspClient, arguments: argparse.Namespace) -> None:
    began = time.monotonic()
    due = began if arguments.trigger or arguments.every else float("inf")
    while not arguments.duration or time.monotonic() - began < arguments.duration:
        if client.connected and time.monotonic() >= due:
            client.trigger()
            print(f"sensor {arguments.id}: motion reported", flush=True)
            due = time.monotonic() + arguments.every if arguments.every else float("inf")
        time.sleep(0.05)


def main() -> None:
    """Run the sensor until Ctrl-C or for --duration."""
    arguments = _arguments()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    try:
        key = key_of(arguments.key_file, arguments.id) if arguments.key_file else None
    except ParamError as err:
        sys.exit(f"esp_client: {err}")
    client = EspClient(arguments.host, arguments.port, arguments.id, key=key, insist=arguments.insist).start()
    try:
        if client.wait_connected(5.0):
            print(f"sensor {arguments.id}: connected to {arguments.host}:{arguments.port}", flush=True)
        else:
            print(f"sensor {arguments.id}: no bridge at {arguments.host}:{arguments.port} yet, trying on", flush=True)
        _play(client, arguments)
    except KeyboardInterrupt:
        print(f"sensor {arguments.id}: ends", flush=True)
    finally:
        client.stop()
