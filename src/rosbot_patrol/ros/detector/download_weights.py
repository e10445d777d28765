"""Program download_weights: downloads a network's files to darknet_ros's folders.

rosrun rosbot_patrol download_weights yolo-fastest-1.1-xl
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import rospkg

from rosbot_patrol.detection.catalogue import CATALOGUE, NetworkFile, PublishedNetwork, check_file
from rosbot_patrol.detection.darknet.cfg import read_cfg
from rosbot_patrol.detection.darknet.weights import read_weights
from rosbot_patrol.detection.download import fetch
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.params import unknown_name

BAR = 30
BAR_PERIOD = 0.2


def main() -> None:
    """Run the program; exit status 1 if a file could not be downloaded."""
    try:
        sys.exit(run([word for word in sys.argv[1:] if ":=" not in word]))  # roslaunch adds __name:=...
    except KeyboardInterrupt:
        print("\nstopped; what came is kept, the same command goes on with it", file=sys.stderr)
        sys.exit(130)


def run(arguments: list[str]) -> int:
    """Download the files that the arguments name; returns the exit status."""
    parser = argparse.ArgumentParser(prog="download_weights", description="Fetch a network's files for darknet_ros.")
    parser.add_argument("name", nargs="?", help="of the network; without it, all that are known are listed")
    parser.add_argument("--folder", type=Path, help="where to put the files; default: where the launch files look")
    parser.add_argument("--url", help="another address of the same file; of a folder with the files if it ends in /")
    wanted = parser.parse_args(arguments)
    if wanted.name is None:
        for entry in CATALOGUE.values():
            print(f"{entry.name:20} {entry.size:>12,} bytes  {entry.files[-1].urls[0]}")
        return 0
    name = wanted.name.removesuffix(".weights")
    if name not in CATALOGUE:
        print(f"download_weights: {unknown_name(wanted.name, CATALOGUE)}", file=sys.stderr)
        return 1
    entry = CATALOGUE[name]
    shared = Path(rospkg.RosPack().get_path("darknet_ros"), "yolo_network_config")
    folder = wanted.folder.expanduser().resolve() if wanted.folder else None
    cfgs = folder if folder and entry.has_cfg else shared / "cfg"
    return get(entry, folder or shared / "weights", cfgs, wanted.url or "")


def get(network: PublishedNetwork, weights: Path, cfgs: Path, url: str = "") -> int:
    """Download a network's files and check that they fit each other; returns the exit status.

    Args:
        network: from the catalogue.
        weights: folder of the weights.
        cfgs: folder of the cfg file, published or ours.
        url: replaces the addresses of the catalogue; a folder if it ends in "/".
    """
    for file in network.files:
        folder = cfgs if file.is_cfg else weights
        try:
            _get_file(file, folder, _addresses(file, url, is_folder=len(network.files) > 1))
        except DetectorError as err:
            print(f"\ndownload_weights: {err}\n{_by_hand(file, folder)}", file=sys.stderr)
            return 1
        except OSError as err:
            print(f"\ndownload_weights: {folder} does not take the file: {err.strerror}", file=sys.stderr)
            return 1
    cfg = cfgs / f"{network.name}.cfg"
    try:
        read_weights(str(weights / network.files[-1].file), read_cfg(str(cfg)))
    except DetectorError as err:
        print(f"\ndownload_weights: {err}", file=sys.stderr)
        return 1
    print(f"it fits {cfg.name}. Start with: roslaunch rosbot_patrol rosbot_patrol.launch network:={network.name}")
    return 0


def _get_file(file: NetworkFile, folder: Path, urls: Sequence[str]) -> None:
    """Download one file unless it is there; one with another sum than the published file's is replaced."""
    target = folder / file.file
    if target.exists():
        problem = _problem_of(target, file)
        if not problem:
            print(f"{target} is there already")
            return
        print(f"{problem}; it is fetched again")
    print(f"fetching {urls[0]}\ninto {target}")
    fetch(urls, target, size=file.size, sums=file.sums, progress=Bar(file.size))


def _problem_of(target: Path, file: NetworkFile) -> str:
    """What is wrong with a file that is there; "" also for one without a published sum."""
    if file.sums:
        try:
            check_file(target, file)
        except DetectorError as err:
            return str(err)
    return ""


def _addresses(file: NetworkFile, url: str, *, is_folder: bool) -> Sequence[str]:
    if not url:
        return file.urls
    return [f"{url.rstrip('/')}/{file.file}" if is_folder or url.endswith("/") else url]


def _by_hand(file: NetworkFile, folder: Path) -> str:
    return (
        f"Where there is no way to it from here, fetch {file.describe()} elsewhere and put it into {folder}; "
        f"its authors offer it at {file.urls[0]}"
    )


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
