"""notify: tests the channels to the owner, and shows the waiting notices; needs no ROS master.

rosrun rosbot_patrol notify --test [--channel NAME] [--config FILE]     a real test notice through each channel
rosrun rosbot_patrol notify --list                                      waiting notices, with reasons
rosrun rosbot_patrol notify --flush                                     retry all waiting notices now

It uses the channels that the robot's nodes were last started with, from the outbox, or those of a file.
Exit status: 0 success, 1 a notice was refused or still waits, 2 it cannot be tried.
"""

from __future__ import annotations

import argparse
import logging
import os
import socket
import sys
import time
from dataclasses import replace
from pathlib import Path

from rosgraph.names import get_ros_namespace

from rosbot_patrol.alerts.channels.channel import Channel
from rosbot_patrol.alerts.channels.channel_check import make_test_notice, try_channel
from rosbot_patrol.alerts.channels.config import Surroundings, load_channels, make_channels
from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.dispatch.delivery import ChannelStatus
from rosbot_patrol.alerts.dispatch.dispatcher import Dispatcher
from rosbot_patrol.alerts.dispatch.settings_file import read_settings
from rosbot_patrol.alerts.dispatch.status_file import PostStatus, read_status
from rosbot_patrol.alerts.outbox.outbox import Outbox
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import unknown_name
from rosbot_patrol.ros.runtime.node import ros_home
from rosbot_patrol.ros.runtime.private_files import use_private_umask
from rosbot_patrol.ros.runtime.state_folder import state_folder

FLUSH_WAIT = 90.0  # [s] for the node that delivers


def main() -> None:
    """Run the program."""
    use_private_umask()
    arguments = [a for a in sys.argv[1:] if not a.startswith("__") and ":=" not in a]
    for name in ("dispatcher", "delivery"):  # their words are printed
        logging.getLogger(f"rosbot_patrol.alerts.dispatch.{name}").disabled = True
    try:
        sys.exit(run(arguments))
    except (ParamError, OSError) as err:
        print(f"notify: {err}", file=sys.stderr)
        sys.exit(2)


def run(arguments: list[str]) -> int:
    """Run the requested command; returns the exit status. Raises ParamError, OSError."""
    options = _parse(arguments)
    folder = state_folder(options.state_dir, get_ros_namespace()) / "outbox"
    around = Surroundings(home=ros_home(), environ=os.environ, host=socket.gethostname())
    if options.list:
        return show(folder)
    channels = _channels(options, folder, around)
    return flush(folder, channels) if options.flush else try_all(channels)


def try_all(channels: list[Channel]) -> int:
    """Send a test notice through each channel."""
    notice = make_test_notice(time.time(), socket.gethostname())
    good = True
    for channel in channels:
        print(f"{channel.name}: {channel.transport.describe()} ...", flush=True)
        tested = try_channel(channel, notice)
        good = good and tested.is_taken
        result = "taken" if tested.is_taken else "NOT taken"
        print(f"{channel.name}: {result} after {tested.seconds:.1f} s: {tested.text}")
        if tested.advice:
            print(f"{channel.name}: {tested.advice}")
    return 0 if good else 1


def show(folder: Path) -> int:
    """List the notices that wait."""
    if not folder.is_dir():
        print(f"There is no outbox at {folder}: no node has used it yet (--state-dir names another place).")
        return 0
    waiting = Outbox(folder).waiting()
    status = read_status(folder)
    print(f"{_count(len(waiting))} in {folder}. Last delivered for by {status.who if status else 'nobody'}.")
    if status:
        _print_channels(status, time.time())
    for entry in waiting:
        print(f"{_when(entry.wall)}  {entry.kind:9} {entry.id}  {Outbox(folder).read(entry).subject[:60]}")
    return 0


def flush(folder: Path, channels: list[Channel]) -> int:
    """Have everything tried now, by the node that delivers, or by this program if none does."""
    if not folder.is_dir():
        return show(folder)
    fast = [replace(channel, pace=replace(channel.pace, interval=0.0)) for channel in channels]
    dispatcher = Dispatcher(Outbox(folder), fast, who="notify --flush")
    if dispatcher.take_over():
        with dispatcher.lock.beating():
            left = _flush_here(dispatcher)
    else:
        print(f"{dispatcher.lock.holder()} delivers and is asked to try all.")
        left = _flush_there(folder)
    print(f"{_count(left)} still." if left else "Nothing waits.")
    return 1 if left else 0


def _flush_here(dispatcher: Dispatcher) -> int:
    print("No node delivers at the moment: this program does.")
    try:
        dispatcher.nudge(all_=True)
        for name in dispatcher.channels:
            while (done := dispatcher.deliver(name)) is not None:
                print(f"{name}: {done.text}")
        dispatcher.refresh()
        dispatcher.write_status()
        return len(dispatcher.outbox.waiting())
    finally:
        dispatcher.hand_over()


def _flush_there(folder: Path) -> int:
    began, outbox = time.time(), Outbox(folder)
    if not outbox.waiting():
        return 0  # the node rewrites its status once a minute only
    (folder / "flush").touch()
    while time.time() - began < FLUSH_WAIT:
        status = read_status(folder)
        has_tried = not (folder / "flush").exists() and status is not None and status.wall > began + 1.0
        if has_tried and not outbox.waiting():
            return 0
        if has_tried and status and all(c.error or not c.waiting for c in status.channels):
            break
        time.sleep(0.2)
    if status := read_status(folder):
        _print_channels(status, status.wall)
    return len(outbox.waiting())


def _channels(options: argparse.Namespace, folder: Path, around: Surroundings) -> list[Channel]:
    if options.config:
        channels = load_channels(Path(options.config).expanduser(), around)
    else:
        known = read_settings(folder) if folder.is_dir() else []
        source = f"as {known[0].who} was started" if known else "by default: no node has left its settings here"
        print(f"Channels {source}.")
        channels = make_channels(known[0].mail if known else MailParams(), around)
    if options.channel:
        names = sorted({name for channel in channels for name in channel.names})
        if options.channel not in names:
            raise ParamError("--channel", unknown_name(options.channel, names))
        channels = [channel for channel in channels if options.channel in channel.names]
    return channels


def _parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="notify", description="Tries the ways to the owner; shows what waits.")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--test", action="store_true", help="send a test notice through each channel")
    what.add_argument("--list", action="store_true", help="what waits, and why")
    what.add_argument("--flush", action="store_true", help="try all that waits now")
    parser.add_argument("--channel", default="", help="this one only; with NAME:ADDRESS one of its recipients")
    parser.add_argument("--config", default="", help="channels of this file instead of those of the robot's nodes")
    parser.add_argument("--state-dir", default="", help="the nodes' state_dir; rosbot_patrol in ROS's home")
    return parser.parse_args(arguments)


def _print_channels(status: PostStatus, now: float) -> None:
    for channel in status.channels:
        print(f"  {_channel_line(channel, now - status.wall)}")


def _channel_line(channel: ChannelStatus, age: float) -> str:
    line = f"{channel.name}: {channel.describe}"
    if not channel.waiting:
        return (
            f"{line}: refused the last notice for good: {channel.refusal}" if channel.refusal else f"{line}: took all"
        )
    line += f": {count_of(channel.waiting, 'waits', 'wait')} since {_when(channel.since or 0.0)}"
    if channel.error:
        line += f", because {channel.error}"
    if channel.next_try is not None:
        line += f"; next try in {max(channel.next_try - age, 0.0):.0f} s"
    return line


def _count(number: int) -> str:
    return count_of(number, "notice waits", "notices wait", none="No")


def _when(wall: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(wall))
