#!/usr/bin/env python3
"""A network cable between this network namespace and that of a process: late, lossy, narrow, and it can be pulled.

    cable.py PID [--delay SECONDS] [--loss SHARE] [--rate BITS_PER_SECOND]

Both ends are TAP devices, eth0, that this process carries the frames between. It says "ready" once both are there, and
reads `cut` and `plug` from its input; after each it says how many frames it carried and lost so far.
"""

import argparse
import ctypes
import fcntl
import heapq
import os
import random
import selectors
import struct
import sys
import time

TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
CLONE_NEWNET = 0x40000000
BACKLOG = 0.2  # what waits for the cable for longer is lost, as in a switch [s]
MOST = 2048  # bytes of a frame


def tap(name):
    """A TAP device in the namespace of this moment."""
    end = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(end, TUNSETIFF, struct.pack("16sH22x", name.encode(), IFF_TAP | IFF_NO_PI))
    return end


def enter(pid):
    """Go to the network namespace of a process."""
    with open(f"/proc/{pid}/ns/net") as space:
        if ctypes.CDLL(None, use_errno=True).setns(space.fileno(), CLONE_NEWNET):
            raise OSError(ctypes.get_errno(), "setns")


class Cable:
    """Frames on their way."""

    def __init__(self, ends, delay, loss, rate, seed=1):
        self.other = {ends[0]: ends[1], ends[1]: ends[0]}
        self.delay, self.loss, self.rate = delay, loss, rate
        self.free = dict.fromkeys(ends, 0.0)  # when the line out of an end is free again
        self.way, self.number = [], 0
        self.is_cut, self.carried, self.lost = False, 0, 0
        self.chance = random.Random(seed)

    def take(self, end, now):
        """All that came out of an end."""
        while True:
            try:
                frame = os.read(end, MOST)
            except BlockingIOError:
                return
            begin = max(now, self.free[end])
            if self.is_cut or begin - now > BACKLOG or self.chance.random() < self.loss:
                self.lost += 1
                continue
            self.free[end] = begin + 8.0 * len(frame) / self.rate
            self.number += 1
            heapq.heappush(self.way, (self.free[end] + self.delay, self.number, self.other[end], frame))

    def give(self, now):
        """What has arrived; returns how long the next one takes [s], None where nothing is on its way."""
        while self.way and self.way[0][0] <= now:
            _, _, end, frame = heapq.heappop(self.way)
            if self.is_cut:
                self.lost += 1
                continue
            try:
                os.write(end, frame)
                self.carried += 1
            except OSError:  # the device is down, or its queue is full
                self.lost += 1
        return self.way[0][0] - now if self.way else None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pid", type=int)
    parser.add_argument("--delay", type=float, default=0.0)
    parser.add_argument("--loss", type=float, default=0.0)
    parser.add_argument("--rate", type=float, default=1e9)
    given = parser.parse_args()
    ends = [tap("eth0")]
    enter(given.pid)
    ends.append(tap("eth0"))
    cable = Cable(ends, given.delay, given.loss, given.rate)
    waiting = selectors.DefaultSelector()
    for each in (*ends, sys.stdin):
        waiting.register(each, selectors.EVENT_READ)
    print("ready", flush=True)
    left = None
    while True:
        for key, _ in waiting.select(left):
            if key.fileobj is not sys.stdin:
                cable.take(key.fileobj, time.monotonic())
                continue
            order = sys.stdin.readline().strip()
            if not order:
                return
            cable.is_cut = order == "cut"
            print(f"{order}: {cable.carried} frames carried, {cable.lost} lost", flush=True)
        left = cable.give(time.monotonic())


if __name__ == "__main__":
    main()
