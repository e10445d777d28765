"""campaign: many seeded patrols of the simulated houses, each compared with ground truth.

    rosrun rosbot_patrol campaign FOLDER --patrols 60
    rosrun rosbot_patrol campaign FOLDER --patrols 100 --faults    # something breaks in every other one
    rosrun rosbot_patrol campaign FOLDER --patrols 300 --generated 100    # in 100 houses drawn by chance
    rosrun rosbot_patrol campaign FOLDER --world small_house.world    # in any world, which the robot explores first
    rosrun rosbot_patrol campaign FOLDER --network yolo-fastest-1.1-xl --figures detailed    # one for real cameras
    rosrun rosbot_patrol campaign FOLDER --only 17        # one of them again
    rosrun rosbot_patrol campaign FOLDER --scheduler tcp://host:8786    # on other machines (docs/campaign.md)
    rosrun rosbot_patrol campaign --work tcp://host:8786  # on each of those machines
    rosrun rosbot_patrol campaign compare A B             # two campaigns' folders; writes B/comparison.html
    rosrun rosbot_patrol campaign FOLDER --crash 200      # patrols in which programs are killed

A second run continues where the first stopped. Exit status: 0, or 1 if anything deviated from the expectation.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import shlex
import shutil
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import rospkg

from rosbot_patrol.campaign.comparison import comparison_page, comparison_text
from rosbot_patrol.campaign.houses.files import HOUSES, moved_scenario
from rosbot_patrol.campaign.page import page
from rosbot_patrol.campaign.plan import Patrol, plan_patrol
from rosbot_patrol.campaign.progress import progress_line
from rosbot_patrol.campaign.record import PLAN, RESULT, CampaignFolder, Result, Settings, results_in
from rosbot_patrol.campaign.table import HEADINGS, figures, markdown_table, row, summary, text_table
from rosbot_patrol.detection.choice import open_network
from rosbot_patrol.errors import PatrolError, WorldError
from rosbot_patrol.files import write_atomic
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.ros.campaign.cluster import Cluster, pack, unpack
from rosbot_patrol.ros.campaign.crash import CrashLife
from rosbot_patrol.ros.campaign.crashes import CrashCampaign
from rosbot_patrol.ros.campaign.far_patrols import patrols_of, work
from rosbot_patrol.ros.campaign.house import HouseError
from rosbot_patrol.ros.campaign.houses import FOLDER as HOUSE_FOLDER
from rosbot_patrol.ros.campaign.houses import Houses, explore, prepare_world
from rosbot_patrol.ros.campaign.patrol import Eyes, play
from rosbot_patrol.ros.campaign.runner import Job, Runner, own_space, raise_loopback

KEPT_FOR_GOOD = (RESULT, PLAN, "scenario.yaml", "mail")  # files kept of a patrol without deviations


def package_root() -> Path:
    """Folder with worlds and maps: the package's, wherever it is installed."""
    return Path(rospkg.RosPack().get_path("rosbot_patrol"))


def options(arguments: list[str]) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        prog="campaign", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", default="campaign", type=Path, help="for plans, results and the page")
    parser.add_argument("--patrols", type=int, default=60, help="how many")
    parser.add_argument("--seed", type=int, default=1, help="of the campaign")
    parser.add_argument("--houses", nargs="+", default=list(HOUSES), choices=HOUSES, help="that take turns")
    parser.add_argument("--generated", type=int, default=0, metavar="N", help="in N houses drawn by chance")
    parser.add_argument("--world", type=Path, metavar="FILE", help="in this world, which the robot explores first")
    parser.add_argument("--map", type=Path, metavar="FILE", help="with --world: its map, instead of the exploration")
    parser.add_argument("--start", type=float, nargs=3, metavar=("X", "Y", "YAW"), help="with --world: of the robot")
    parser.add_argument("--explore-timeout", type=float, default=1800.0, help="for the exploration [s] of real time")
    parser.add_argument("--jobs", type=int, default=max((os.cpu_count() or 2) // 2, 1), help="at once, two cores each")
    parser.add_argument("--timeout", type=float, default=600.0, help="for a patrol [s] of real time")
    parser.add_argument("--only", type=int, nargs="+", help="numbers of the patrols to play, again where played")
    parser.add_argument("--wrap", default="", help="command to run each patrol under, such as 'flock FILE'")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="play on the workers of this dask scheduler")
    parser.add_argument("--work", metavar="ADDRESS", help="play patrols for this dask scheduler, --jobs at once")
    parser.add_argument(
        "--crash", type=int, metavar="KILLS", help="kill programs instead, so often; see docs/campaign.md"
    )
    parser.add_argument("--network", default="house", help="that looks for people, as network:= takes it")
    parser.add_argument("--figures", default="plain", choices=("plain", "detailed"), help="of simulated people")
    parser.add_argument("--hardware", action="store_true", help="through emulated devices and a robot's drivers")
    parser.add_argument(
        "--faults",
        type=int,
        nargs="?",
        const=2,
        default=0,
        metavar="K",
        help="in every K-th patrol (2) something breaks",
    )
    parser.add_argument("--explore", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--life", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)  # run inside its own network and process space
    parser.add_argument("--space", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


class Campaign:
    """Patrols of a folder.

    Raises:
        DetectorError: the network's files are missing or damaged.
        ParamError: there is no such network.
    """

    def __init__(self, given: argparse.Namespace) -> None:
        open_network(given.network)  # without it nobody would be seen, and each patrol be a miss
        self._given = given
        self._root = package_root()
        settings = Settings(
            seed=given.seed,
            houses=tuple(given.houses),
            faults=given.faults,
            network=given.network,
            figures=given.figures,
            hardware=given.hardware,
            generated=given.generated,
            world=str(given.world.resolve()) if given.world else "",
        )
        self._settings = settings
        self._folder = CampaignFolder(given.folder.resolve(), settings)
        self._houses = Houses(settings, self._root, self._folder.folder)
        self._began = time.monotonic()
        self._here = 0

    def run(self) -> int:
        """Run the patrols that have not run yet; returns the exit status."""
        numbers = self._given.only or range(self._given.patrols)
        wanted = [n for n in numbers if self._given.only or self._folder.result(n) is None]
        self._total = len(set(numbers) | {r.number for r in self._folder.results()})
        prefix = own_space()
        if not prefix:
            print("no network spaces of one's own here (unshare is refused): one patrol at a time", flush=True)
        if given_world := self._settings.world:
            self._prepare(Path(given_world), prefix)
        runner = Runner(self._given.jobs, prefix, shlex.split(self._given.wrap), self._done)
        self._tell()
        try:
            if self._given.scheduler:
                self._run_elsewhere(self._given.scheduler, wanted)
            else:
                runner.run(self._job(number, bool(prefix)) for number in wanted)
        except KeyboardInterrupt:
            runner.stop()
            print(f"\nstopped; run the same again to go on in {self._folder.folder}")
            return 130
        self._write()
        results = self._folder.results()
        print(f"\n{text_table(HEADINGS, map(row, results))}\n\n{summary(results)}\n\n{self._failures(results)}")
        return 1 if any(result.failures for result in results) else 0

    def _run_elsewhere(self, address: str, wanted: list[int]) -> None:
        """Play patrols on the workers of a scheduler. Raises ClusterError."""
        cluster = Cluster(address, patrols_of(self._root, self._words()))
        base = self._folder.folder

        def packed(number: int) -> tuple[str, bytes]:
            folder = self._planned(number)
            house = base / HOUSE_FOLDER / self._houses.name_of(number)
            return folder.name, pack(base, [folder, *([house] if house.is_dir() else [])])

        try:
            for name, problem, data in cluster.results(map(packed, wanted)):
                if data:
                    unpack(data, base)
                self._done(Job(name, (), base / name / "campaign.log", 0.0), problem)
        finally:
            cluster.close()

    def _prepare(self, world: Path, prefix: list[str]) -> None:
        given = self._given
        prepare_world(
            world,
            self._folder.folder,
            start=Pose2D(*given.start) if given.start else None,
            map_file=given.map,
            timeout=given.explore_timeout,
            prefix=prefix,
        )

    def _job(self, number: int, space: bool) -> Job:
        folder = self._planned(number)
        command = [sys.executable, sys.argv[0], "--one", str(folder), *self._words()]
        return Job(str(number), command + ["--space"] * space, folder / "campaign.log", self._given.timeout)

    def _words(self) -> list[str]:
        """Arguments with which a patrol is played."""
        given = self._given
        words = ["--timeout", str(given.timeout), "--network", given.network, "--figures", given.figures]
        return words + ["--hardware"] * given.hardware

    def _planned(self, number: int) -> Path:
        """The folder of a patrol, with its plan only."""
        folder = self._folder.of(number)
        shutil.rmtree(folder, ignore_errors=True)
        patrol = self._plan(number)
        kept = patrol if self._settings.is_own else replace(patrol, scenario=moved_scenario(patrol.scenario, folder))
        write_atomic(folder / PLAN, json.dumps(kept.to_plain(), indent=1).encode())
        return folder

    def _plan(self, number: int) -> Patrol:
        place, settings = self._houses.of(number), self._settings
        patrol = plan_patrol(
            settings.seed,
            number,
            place.house.files,
            place.floor,
            faults=settings.faults,
            mix=settings.mix,
            is_light_drawn=not settings.is_own,
        )
        return replace(patrol, people=(*patrol.people, *place.house.people))

    def _done(self, job: Job, problem: str) -> None:
        number = int(job.name)
        folder = self._folder.of(number)
        if self._folder.result(number) is None:
            patrol = self._plan(number)
            failed = Result(
                number=number,
                seed=patrol.seed,
                kind=patrol.kind,
                house=patrol.house,
                room=patrol.room,
                title=patrol.title,
                expected=patrol.expected,
                mishap=patrol.mishap,
                allowed=patrol.allowed,
                problem=problem or "left no result",
            )
            write_atomic(folder / RESULT, failed.to_json().encode())
        result = self._folder.result(number)
        assert result is not None
        if not result.failures:
            for path in folder.iterdir():
                if path.name not in KEPT_FOR_GOOD:
                    shutil.rmtree(path) if path.is_dir() else path.unlink()
        self._here += 1
        self._write()
        self._tell(result)

    def _tell(self, result: Result | None = None) -> None:
        results = self._folder.results()
        failed = sum(bool(r.failures) for r in results)
        if result is not None:
            how = "; ".join(result.failures) or result.verdict
            print(f"\r\x1b[K{result.number:4d}  {result.title}: {how}")
        elapsed = time.monotonic() - self._began
        line = progress_line(len(results), self._total, self._here, elapsed, failed=failed)
        print(f"\r\x1b[K{line}" if sys.stdout.isatty() else line, end="" if sys.stdout.isatty() else "\n", flush=True)

    def _failures(self, results: list[Result]) -> str:
        failed = [r for r in results if r.failures]
        if not failed:
            return "Everything was as it should be."
        lines = [f"{r.number}: {'; '.join(r.failures)} ({r.title})\n    {self.command(r)}" for r in failed]
        return "Not as they should be, each with the command that plays it again:\n" + "\n".join(lines)

    def command(self, result: Result) -> str:
        """Command that repeats a patrol."""
        houses = f" --houses {' '.join(self._given.houses)}" if tuple(self._given.houses) != HOUSES else ""
        given, usual = self._given, options([])
        folder, more = f"again-{result.number}", houses + f" --faults {given.faults}" * bool(given.faults)
        more += f" --generated {given.generated}" * bool(given.generated)
        more += f" --world {given.world}" * bool(given.world) + f" --map {given.map}" * bool(given.map)
        more += f" --start {' '.join(map(str, given.start or ()))}" * bool(given.start)
        more += f" --network {given.network}" * (given.network != usual.network)
        more += f" --figures {given.figures}" * (given.figures != usual.figures) + " --hardware" * given.hardware
        return f"rosrun rosbot_patrol campaign {folder} --seed {result.seed}{more} --only {result.number}"

    def _write(self) -> None:
        results = self._folder.results()
        folder = self._folder.folder
        table = markdown_table(HEADINGS, map(row, results))
        write_atomic(folder / "results.md", f"{table}\n\n{summary(results)}\n\n{self._failures(results)}\n".encode())
        given = self._given
        eyes = f"network {given.network}, {given.figures} people" + ", emulated hardware" * given.hardware
        where = (
            f"{given.generated} drawn houses" if given.generated else given.world or f"houses {', '.join(given.houses)}"
        )
        subtitle = f"seed {given.seed}, {where}, {eyes}, {os.cpu_count()} cores"
        write_atomic(folder / "index.html", page(results, self.command, subtitle=subtitle).encode())
        write_atomic(folder / "results.json", json.dumps(figures(results), indent=1).encode())


def in_its_space(given: argparse.Namespace) -> int:
    """Run the program as a child started by itself: one patrol, or one life of a crash campaign; the exit status."""
    if given.space:
        raise_loopback()
    status = 0
    try:
        if given.explore:
            explore(given.world, given.folder, Pose2D(*given.start), given.timeout)
        elif given.one:
            play(
                given.one,
                package_root(),
                given.timeout,
                Eyes(network=given.network, figures=given.figures, is_hardware=given.hardware),
            )
        else:
            CrashLife(given.folder, package_root(), given.seed, given.crash).run()
    except (HouseError, WorldError) as err:
        print(err)
        status = 1
    sys.stdout.flush()
    return status


def compare(arguments: list[str]) -> int:
    """Compare two campaigns: print the tables, write the page; the exit status."""
    parser = argparse.ArgumentParser(prog="campaign compare", description="Compare the campaigns in two folders.")
    parser.add_argument("first", type=Path, help="folder of the campaign before")
    parser.add_argument("second", type=Path, help="folder of the campaign after; comparison.html is written there")
    given = parser.parse_args(arguments)
    first, second = (results_in(folder) for folder in (given.first, given.second))
    print(comparison_text(first, second))
    path = given.second / "comparison.html"
    write_atomic(path, comparison_page(first, second, subtitle=f"{given.first} and {given.second}").encode())
    print(f"\n{path}")
    return 0


def main() -> None:
    """Run the program."""
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(message)s")
    if sys.argv[1:2] == ["compare"]:
        try:
            sys.exit(compare(sys.argv[2:]))
        except (PatrolError, OSError) as err:
            print(f"campaign: {err}", file=sys.stderr)
            sys.exit(2)
    given = options(sys.argv[1:])
    for number in (signal.SIGINT, signal.SIGTERM):  # a shell ignores SIGINT in background programs
        signal.signal(number, signal.default_int_handler)
    try:
        if given.one or given.life or given.explore:
            os._exit(in_its_space(given))  # rospy's threads would linger
        if given.work:
            work(given.work, given.jobs)
            sys.exit(0)
        if given.crash is not None:
            wrap = shlex.split(given.wrap)
            sys.exit(CrashCampaign(given.folder, given.seed, given.crash, wrap).run())
        sys.exit(Campaign(given).run())
    except (PatrolError, OSError) as err:
        print(f"campaign: {err}", file=sys.stderr)
        sys.exit(2)  # 1 means a patrol with a deviation
