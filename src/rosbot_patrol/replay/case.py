"""Test case of a replay: NAME.replay.yaml beside a bag.

    bag: house.bag
    node: amcl
    parameters: amcl.yaml           # a file, or the parameters themselves; default: the package's config
    map: house.yaml                 # default: the bag's /map
    topics: {scan: /front_scan}     # topics with other names in the bag
    transforms: ["0 0 0.1 0 0 0 base_link laser"]
    rooms: points.yaml              # for patrol_robot
    seed: 0
    expected: house.expected.npz    # default: NAME.expected.npz
    tolerances: {poses.x: 0.1}
    optional: false                 # true: the test is skipped if the bag is missing

Paths are relative to the folder of the yaml.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rosbot_patrol import params
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import param
from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.nodes.setup import Setup, build_replay, node_of, parse_transform, read_parameters
from rosbot_patrol.replay.results.comparison import Field, field_names, field_of
from rosbot_patrol.replay.results.tables import Result
from rosbot_patrol.replay.runner import run_replay
from rosbot_patrol.yaml_files import read_mapping

SUFFIX = ".replay.yaml"


@dataclass(frozen=True, kw_only=True)
class CaseParams:
    """Keys of a NAME.replay.yaml."""

    bag: str = param(doc="bag to replay")
    node: str = param(doc="node to replay: amcl, slam_gmapping, move_base, darknet_ros, patrol_robot, serial_node")
    parameters: Any = param(None, doc="parameters of the node: a yaml file, or a mapping; none: those in config/")
    map: str = param("", doc="yaml file of the map; empty: the bag's map")
    topics: dict[str, Any] = param({}, doc="topics of the bag, by the node's own names")
    transforms: list[str] = param([], doc="static transforms missing in the bag: 'x y z yaw pitch roll PARENT CHILD'")
    rooms: str = param("", doc="points file of patrol_robot; empty: its path_to_params, else the one of our house")
    seed: int = param(0, lo=0, doc="seed of all random numbers")
    expected: str = param("", doc="stored result; empty: NAME.expected.npz")
    tolerances: dict[str, Any] = param(
        {}, doc="tolerances by field, such as poses.x or poses.*; other fields keep the node's own"
    )
    optional: bool = param(False, doc="as a test, skip the case if the bag is missing")


@dataclass(frozen=True)
class Case:
    """One replay and its expected result.

    Attributes:
        path: path of the yaml.
        bag: the bag.
        setup: the replay.
        remaps: topics of the bag by the node's names.
        expected: path of the stored result.
        fields: tolerances of the comparison.
        is_optional: the test is skipped if the bag is missing.
        named: fields with a tolerance in the yaml.
    """

    path: Path
    bag: Path
    setup: Setup
    remaps: Mapping[str, str]
    expected: Path
    fields: Mapping[str, Field]
    is_optional: bool = False
    named: tuple[str, ...] = ()


def read_case(path: Path) -> Case:
    """Read and check a case.

    Raises:
        ParamError: the yaml or its parameter file is broken; the text names file and key.
    """
    tree = read_mapping(path, keys="bag, node, ...")
    loaded = params.load_strict(CaseParams, tree, name=f"{path}: ")
    node_of(loaded.node)
    folder = path.parent
    setup = Setup(
        node=loaded.node,
        tree=_tree(path, loaded),
        name=f"{path}: parameters/",
        map=folder / loaded.map if loaded.map else None,
        static=tuple(parse_transform(text) for text in loaded.transforms),
        seed=loaded.seed,
        rooms=folder / loaded.rooms if loaded.rooms else None,
    )
    expected = folder / (loaded.expected or f"{path.name.removesuffix(SUFFIX)}.expected.npz")
    remaps = {name: str(topic) for name, topic in loaded.topics.items()}
    fields = with_tolerances(node_of(loaded.node).fields, loaded.tolerances, name=f"{path}: tolerances/")
    named = tuple(loaded.tolerances)
    return Case(path, folder / loaded.bag, setup, remaps, expected, fields, loaded.optional, named)


def run_case(case: Case, *, progress: Callable[[float], None] = lambda _share: None) -> Result:
    """Replay a case; the result records its origin.

    Raises:
        PatrolError: bag, parameters or map cannot be used, or a tolerance is for a field that the result lacks.
    """
    replay = build_replay(case.setup)
    with Bag(case.bag) as bag:
        result = run_replay(bag, replay, remaps=case.remaps, progress=progress)
        _check_names(case.named, result)
        own = {"bag": case.bag.name, "duration": f"{bag.duration:.3f} s"}
        return replace(result, facts={**own, **result.facts})


def _tree(path: Path, loaded: CaseParams) -> Mapping[str, Any] | None:
    given = loaded.parameters
    if given is None or isinstance(given, Mapping):
        return given
    if isinstance(given, str):
        return read_parameters(path.parent / given, loaded.node)
    raise ParamError(f"{path}: parameters", f"expected a yaml file or the parameters themselves, got {given!r}")


def with_tolerances(fields: Mapping[str, Field], given: Mapping[str, Any], *, name: str) -> dict[str, Field]:
    """Replace tolerances of fields; the given ones come last, so that their wildcards take precedence.

    Raises:
        ParamError: a tolerance is not a number, or less than 0.
    """
    found = dict(fields)
    for key, value in given.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not value >= 0.0:
            raise ParamError(f"{name}{key}", f"expected a number from 0 up, got {value!r}")
        for known in [each for each in found if _fits(each, key)] or [key]:
            found[known] = replace(field_of(known, found), tolerance=float(value))
        found[key] = replace(field_of(key, found), tolerance=float(value))
    return found


def _fits(name: str, pattern: str) -> bool:
    return field_of(name, {pattern: Field(tolerance=1.0)}).tolerance == 1.0


def _check_names(given: Iterable[str], result: Result) -> None:
    """Refuse tolerances for fields that a result lacks; raises ParamError, which names the nearest."""
    names = field_names(result)
    for key in given:
        if not any(_fits(each, key) for each in names):
            raise ParamError(f"tolerance of {key}", params.unknown_name(key, names))
