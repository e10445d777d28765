"""replay: a bag through a node's core, offline, as fast as possible, with the same result each time.

    rosrun rosbot_patrol replay house.bag                          # lists contents, and nodes that can be replayed
    rosrun rosbot_patrol replay house.bag --node amcl --map house.yaml --record amcl.npz
    rosrun rosbot_patrol replay house.bag --node amcl --map house.yaml --check amcl.npz --plots out
    rosrun rosbot_patrol replay house.bag --node slam_gmapping scan:=/front_scan --save-map my_house
    rosrun rosbot_patrol replay house.replay.yaml                  # a test case; --record refreshes it

Exit status: 0 equal (or no comparison), 1 different, 2 unusable input.
"""

from __future__ import annotations

import argparse
import logging
import re
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import BagError, ParamError, PatrolError
from rosbot_patrol.maps.map_io import write_map
from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.case import SUFFIX, Case, read_case, run_case, with_tolerances
from rosbot_patrol.replay.nodes.setup import NODES, Setup, node_of, parse_transform, read_parameters
from rosbot_patrol.replay.results.comparison import compare
from rosbot_patrol.replay.results.plots import write_plots
from rosbot_patrol.replay.results.tables import Result, load_result, save_result
from rosbot_patrol.replay.runner import chosen_topics

_MISSING = re.compile(r"no transform from '([^']+)' to '([^']+)'")
SAME, DIFFERS, NO_UPDATE, BAD_INPUT = 0, 1, 1, 2
BAR, EVERY_S = 30, 0.1  # width of the progress bar, and its drawing period


def parser() -> argparse.ArgumentParser:
    """The command-line parser."""
    found = argparse.ArgumentParser(
        prog="replay",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="NAME:=TOPIC takes an input of the node from another topic of the bag, as in scan:=/front_scan.",
    )
    add = found.add_argument
    add("bag", type=Path, metavar="BAG", help=f"a ROS 1 bag, a ROS 2 bag's folder, or a test case (NAME{SUFFIX})")
    add("--node", choices=sorted(NODES), help="whose objects; without it the bag's topics are listed")
    add("--params", type=Path, metavar="FILE", help="yaml of the node's parameters; without it the package's own")
    add("--map", type=Path, metavar="FILE", help="yaml of the map; without it amcl takes the bag's /map")
    add(
        "--transform",
        action="append",
        default=[],
        metavar="TEXT",
        help="a static transform that the bag lacks: 'x y z yaw pitch roll PARENT CHILD'",
    )
    add(
        "--rooms", type=Path, metavar="FILE", help="points file of the patrol; without it path_to_params or our house's"
    )
    add("--seed", type=int, default=0, help="of all chance (0)")
    what = found.add_mutually_exclusive_group()
    what.add_argument("--record", nargs="?", const="", metavar="FILE", help="store the result; a case knows its file")
    what.add_argument("--check", type=Path, metavar="FILE", help="compare with a stored result")
    add("--tolerance", action="append", default=[], metavar="FIELD=VALUE", help="as poses.x=0.1, poses.*=0 or map=0.05")
    add("--exact", action="store_true", help="bit for bit, whatever the tolerances")
    add("--plots", type=Path, metavar="FOLDER", help="draw the result there, the stored one behind it")
    add("--save-map", metavar="STEM", help="write the map that was made as STEM.pgm and STEM.yaml")
    add("--quiet", action="store_true", help="say only what differs")
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the program."""
    logging.basicConfig(format="%(levelname)s: %(message)s", level=logging.WARNING)
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: Sequence[str]) -> int:
    """Execute a command line; returns the exit status."""
    remaps = dict(word.split(":=", 1) for word in arguments if ":=" in word)
    options = parser().parse_args([word for word in arguments if ":=" not in word])
    try:
        if options.node is None and not options.bag.name.endswith(SUFFIX):
            return _list(options.bag)
        case = _case(options, remaps)
        result = _replayed(case, is_quiet=options.quiet)
        if result.counts.get("updates") == 0:
            sys.stderr.write(f"replay: {_no_update(case, result)}\n")
            return NO_UPDATE
        return _finish(case, result, options)
    except PatrolError as err:
        sys.stderr.write(f"replay: {err}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("replay: ended by hand, nothing was compared\n")
        return BAD_INPUT


def _case(options: argparse.Namespace, remaps: Mapping[str, str]) -> Case:
    """The case given by the command line, or by the file that it names."""
    given = _tolerances(options.tolerance)
    if options.bag.name.endswith(SUFFIX):
        case = read_case(options.bag)
    else:
        setup = Setup(
            node=options.node,
            tree=None if options.params is None else read_parameters(options.params, options.node),
            name=f"{options.params}: ",
            map=options.map,
            static=tuple(parse_transform(text) for text in options.transform),
            seed=options.seed,
            rooms=options.rooms,
        )
        fields = node_of(options.node).fields
        case = Case(options.bag, options.bag, setup, remaps, options.check or Path(options.record or ""), fields)
    fields = with_tolerances(case.fields, given, name="--tolerance ")
    if options.exact:
        fields = {name: replace(field, tolerance=0.0) for name, field in fields.items()}
    expected = Path(options.record) if options.record else options.check or case.expected
    return replace(case, fields=fields, expected=expected, named=(*case.named, *given))


def _tolerances(texts: Sequence[str]) -> dict[str, float]:
    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name] = float(value)
        except ValueError as err:
            raise ParamError("--tolerance", f"expected FIELD=VALUE as poses.x=0.1, got '{text}'") from err
    return found


def _replayed(case: Case, *, is_quiet: bool) -> Result:
    bar = _Bar()
    try:
        result = run_case(case, progress=bar.show)
    finally:
        bar.clear()
    if not is_quiet:
        counts = ", ".join(f"{name} {value}" for name, value in result.counts.items())
        sys.stdout.write(f"{result.node} over {case.bag}: {result.facts['duration']} of bag in {bar.elapsed:.2f} s\n")
        left_out = f"  left out: {result.facts['left out']}\n" if "left out" in result.facts else ""
        sys.stdout.write(f"  {counts}\n{left_out}  result {result.digest}\n")
    return result


def _no_update(case: Case, result: Result) -> str:
    """A result without an update, in words: nothing of it is worth keeping."""
    why = result.facts.get("left out")
    left_out = f" Left out: {why}." if why else ""
    missing = _MISSING.search(why or "")
    told = "x y z yaw pitch roll {1} {0}".format(*missing.groups()) if missing else "x y z yaw pitch roll PARENT CHILD"
    return (
        f"{result.node} has made no update over {case.bag}, so nothing is written.{left_out} Compare the names of its"
        f" frames and topics with the bag's: `replay {case.bag}` lists them, and --transform '{told}' gives a missing"
        " transform, such as where the lidar is mounted"
    )


def _finish(case: Case, result: Result, options: argparse.Namespace) -> int:
    """Store or compare the result, and draw."""
    if options.save_map:
        if "map" not in result.grids:
            raise ParamError("--save-map", f"{result.node} makes no map")
        write_map(options.save_map, result.grids["map"])
    is_case = options.bag.name.endswith(SUFFIX)
    if options.record is not None:
        if case.expected == Path():
            raise ParamError("--record", "expected the file to store the result in")
        save_result(case.expected, result)
        _say(options, f"stored in {case.expected}")
    stored = load_result(case.expected) if options.check or (is_case and options.record is None) else None
    if options.plots:
        written = write_plots(options.plots, result, stored, case.fields)
        _say(options, f"{count_of(len(written), 'picture')} in {options.plots}")
    return SAME if stored is None else _compared(case, stored, result, options)


def _compared(case: Case, stored: Result, result: Result, options: argparse.Namespace) -> int:
    differences = compare(stored, result, case.fields)
    if not differences:
        exactly = "bit for bit" if stored.digest == result.digest else "within the tolerances"
        _say(options, f"the same as {case.expected}, {exactly}")
        return SAME
    sys.stdout.write(f"{result.node} over {case.bag} differs from {case.expected}:\n")
    sys.stdout.writelines(f"  {difference}\n" for difference in differences)
    return DIFFERS


def _say(options: argparse.Namespace, text: str) -> None:
    if not options.quiet:
        sys.stdout.write(f"  {text}\n")


def _list(path: Path) -> int:
    """List a bag's contents, and the nodes that can be replayed from it."""
    with Bag(path) as bag:
        sys.stdout.write(f"{path}: {bag.duration:.1f} s\n")
        counts, width = bag.counts(), max(map(len, bag.topics), default=0)
        for topic, kind in sorted(bag.topics.items()):
            sys.stdout.write(f"  {topic:{width}s}  {counts[topic]:7d}  {kind}\n")
        for name, node in NODES.items():
            try:
                chosen_topics(bag, node.inputs, {})
                sys.stdout.write(f"  --node {name}: has all that it needs\n")
            except BagError as err:
                sys.stdout.write(f"  --node {name}: {err.problem}\n")
    return SAME


class _Bar:
    """A progress bar, on a terminal only."""

    def __init__(self) -> None:
        self._begin = self._drawn = time.perf_counter()
        self._is_shown = sys.stderr.isatty()

    @property
    def elapsed(self) -> float:
        """Time since its start [s]."""
        return time.perf_counter() - self._begin

    def show(self, share: float) -> None:
        """Draw it, if it is due."""
        if not self._is_shown or time.perf_counter() - self._drawn < EVERY_S:
            return
        self._drawn = time.perf_counter()
        filled = round(BAR * share)
        left = self.elapsed * (1.0 - share) / share if share else 0.0
        sys.stderr.write(f"\r[{'#' * filled}{'.' * (BAR - filled)}] {share:4.0%}, {left:.0f} s left \x1b[K")
        sys.stderr.flush()

    def clear(self) -> None:
        """Remove it."""
        if self._is_shown:
            sys.stderr.write("\r\x1b[K")
