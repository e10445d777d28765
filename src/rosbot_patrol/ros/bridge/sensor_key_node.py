"""sensor_key: makes the key that identifies a motion sensor to the bridge; needs no ROS master.

rosrun rosbot_patrol sensor_key 2 --file ~/.config/rosbot_patrol/sensor_keys.yaml
"""

from __future__ import annotations

import argparse
import sys

from rosbot_patrol.errors import ParamError
from rosbot_patrol.rosserial.protocol.keys import add_key, c_define, new_key, yaml_line


def main() -> None:
    """Make one key, print it for bridge and firmware, and add it to the bridge's file if one is named."""
    parser = argparse.ArgumentParser(prog="sensor_key", description="Makes the key of a motion sensor.")
    parser.add_argument("id", type=int, help="the sensor's id, 0 to 255")
    parser.add_argument("--file", default="", help="add it to this key file, which is made where it is not there")
    parser.add_argument("--replace", action="store_true", help="replace the key that the file has of this sensor")
    arguments = parser.parse_args([a for a in sys.argv[1:] if not a.startswith("__") and ":=" not in a])
    if not 0 <= arguments.id <= 255:
        parser.error(f"{arguments.id}: expected a sensor id, 0 to 255")
    key = new_key()
    if arguments.file:
        try:
            add_key(arguments.file, arguments.id, key, is_replacing=arguments.replace)
        except ParamError as err:
            sys.exit(f"sensor_key: {err}")
        print(f"# added to {arguments.file}, which serial_node takes as ~key_file; it reads it when it starts")
    else:
        print("# the bridge's key file (chmod 600), serial_node takes it as ~key_file:")
        print(f"keys:\n{yaml_line(arguments.id, key)}")
    print(f"\n// the firmware's header:\n{c_define(arguments.id, key)}")
