"""Program download_weights: downloads a network's weights to darknet_ros's folder.

rosrun rosbot_patrol download_weights yolov2-tiny
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import rospkg

from rosbot_patrol.detection.darknet.cfg import read_cfg
from rosbot_patrol.detection.darknet.weights import read_weights
from rosbot_patrol.detection.download import fetch
from rosbot_patrol.detection.weights_catalogue import CATALOGUE, WeightsFile
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.params import unknown_name

BAR = 30
BAR_PERIOD = 0.2


def main() -> None:
    """Run the program; exit status 1 if the file could not be downloaded."""
    try:
        sys.exit(run([word for word in sys.argv[1:] if ":=" not in word]))  # roslaunch adds __name:=...
    except KeyboardInterrupt:
        print("\nstopped; what came is kept, the same command goes on with it", file=sys.stderr)
        sys.exit(130)


def run(arguments: list[str]) -> int:
    """Download the files that the arguments name; returns the exit status."""
    parser = argparse.ArgumentParser(prog="download_weights", description="Fetch a network's weights for darknet_ros.")
    parser.add_argument("name", nargs="?", help="of the network; without it, all that are known are listed")
    parser.add_argument("--folder", type=Path, help="where to put it; default: where the launch files look")
    parser.add_argument("--url", help="another place to fetch it from; it has to be the same file")
    wanted = parser.parse_args(arguments)
    if wanted.name is None:
        for entry in CATALOGUE.values():
            print(f"{entry.name:16} {entry.size:>12,} bytes  {entry.url}")
        return 0
    name = wanted.name.removesuffix(".weights")
    if name not in CATALOGUE:
        print(f"download_weights: {unknown_name(wanted.name, CATALOGUE)}", file=sys.stderr)
        return 1
    entry = CATALOGUE[name]
    network = Path(rospkg.RosPack().get_path("darknet_ros"), "yolo_network_config")
    folder = wanted.folder or network / "weights"
    return get(entry, folder.expanduser().resolve(), network / "cfg" / f"{entry.name}.cfg", wanted.url or entry.url)


def get(entry: WeightsFile, folder: Path, cfg: Path, url: str) -> int:
    """Download one file and check it against its network; returns the exit status."""
    target = folder / entry.file
    try:
        if target.exists():
            print(f"{target} is there already")
        else:
            print(f"fetching {url}\ninto {target}")
            fetch(url, target, size=entry.size, sha256=entry.sha256, progress=Bar(entry.size))
        read_weights(str(target), read_cfg(str(cfg)))
    except DetectorError as err:
        print(f"\ndownload_weights: {err}", file=sys.stderr)
        if not target.exists():
            print(
                f"Where there is no way to it from here, fetch {entry.describe()} elsewhere and put it into {folder}; "
                f"its authors offer it at {entry.url}",
                file=sys.stderr,
            )
        return 1
    except OSError as err:
        print(f"\ndownload_weights: {folder} does not take the file: {err.strerror}", file=sys.stderr)
        return 1
    print(f"it fits {cfg.name}. Start with: roslaunch rosbot_patrol rosbot_patrol.launch network:={entry.name}")
    return 0


class Bar:
    """Progress bar; without a terminal, one line per tenth.

    Args:
        size: size of the whole file [bytes].
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._terminal = sys.stderr.isatty()
        self._begun: tuple[float, int] | None = None
        self._due = 0.0
        self._tenth = -1

    def __call__(self, have: int) -> None:
        """Show the number of bytes received."""
        now = time.monotonic()
        if self._begun is None:
            self._begun = (now, have)
        if self._terminal and (now >= self._due or have == self._size):
            self._due = now + BAR_PERIOD
            sys.stderr.write(f"\r{self._line(now, have)} ")
            if have == self._size:
                sys.stderr.write("\n")
            sys.stderr.flush()
        elif not self._terminal and have * 10 // self._size > self._tenth:
            self._tenth = have * 10 // self._size
            print(f"{have * 100 // self._size} %, {have:,} of {self._size:,} bytes", flush=True)

    def _line(self, now: float, have: int) -> str:
        assert self._begun is not None
        seconds, got = now - self._begun[0], have - self._begun[1]
        rate = got / seconds if seconds > 0 else 0.0
        left = f"{(self._size - have) / rate:.0f} s left" if rate > 0 else ""
        done = have * BAR // self._size
        bar = "#" * done + "." * (BAR - done)
        return f"[{bar}] {have * 100 // self._size:3} %  {have / 1e6:.1f} MB  {rate / 1e6:.1f} MB/s  {left:12}"
