"""Common part of all replays: the inputs of a node, and a bag fed to it on the bag's own clock."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from rosbot_patrol.errors import BagError
from rosbot_patrol.replay.bags.bag import Bag
from rosbot_patrol.replay.bags.records import Kind
from rosbot_patrol.replay.results.tables import Result

TF_TYPES = ("tf2_msgs/TFMessage", "tf/tfMessage")


@dataclass(frozen=True, kw_only=True)
class Input:
    """One input topic of a node.

    Attributes:
        name: in the node.
        topic: its default topic in the bag, "": the name.
        types: accepted message types, in ROS 1's spelling.
        is_needed: the replay is impossible without it.
        instead: what the user can give if it is needed and missing.
    """

    name: str
    topic: str = ""
    types: tuple[str, ...]
    is_needed: bool = True
    instead: str = ""


class Replay(Protocol):
    """A node's core and its node's own work, over a bag."""

    @property
    def inputs(self) -> Sequence[Input]:
        """Inputs of the node."""

    @property
    def kinds(self) -> Mapping[str, Kind]:
        """Conversion of the messages, by their types."""

    def begin(self, names: Collection[str]) -> None:
        """Note which inputs will be heard, before the first record."""

    def hear(self, name: str, now: float, content: Any) -> None:
        """Process a record of the input of that name, recorded at a time [s]."""

    def finish(self) -> Result:
        """Result of the replay."""


def run_replay(
    bag: Bag,
    replay: Replay,
    *,
    remaps: Mapping[str, str] | None = None,
    told: Callable[[float], None] = lambda _share: None,
) -> Result:
    """Feed a whole bag.

    Args:
        bag: open.
        replay: of a node.
        remaps: topics of the bag by the names of the inputs, where they differ.
        told: called after each record with the share done.

    Raises:
        BagError: a needed topic is missing or of another type, or the bag is broken.
    """
    names = chosen_topics(bag, replay.inputs, remaps or {})
    replay.begin(names.values())
    for record in bag.records(names, replay.kinds):
        replay.hear(names[record.topic], record.time, record.content)
        told(bag.done)
    return replay.finish()


def chosen_topics(bag: Bag, inputs: Sequence[Input], remaps: Mapping[str, str]) -> dict[str, str]:
    """Names of the inputs, by the bag's topics.

    Raises:
        BagError: a topic is missing or of another type; names likely ones.
    """
    unknown = sorted(set(remaps) - {each.name for each in inputs})
    if unknown:
        known = ", ".join(each.name for each in inputs)
        raise BagError(bag.path, f"nothing is called '{unknown[0]}' there, expected one of {known} before the ':='")
    chosen = {}
    for each in inputs:
        topic = _topic_of(bag, each, remaps.get(each.name))
        if topic is not None:
            chosen[topic] = each.name
    return chosen


def _topic_of(bag: Bag, wanted: Input, remapped: str | None) -> str | None:
    usual = wanted.topic or wanted.name
    topic = bag.find(remapped or usual)
    if topic is None:
        if wanted.is_needed or remapped is not None:
            raise BagError(bag.path, _missing(bag, wanted, remapped or f"/{usual}"))
        return None
    found = bag.topics[topic]
    if found not in wanted.types:
        raise BagError(bag.path, f"topic '{topic}' is {found}, expected {' or '.join(wanted.types)}")
    return topic


def _missing(bag: Bag, wanted: Input, topic: str) -> str:
    others = sorted(name for name, kind in bag.topics.items() if kind in wanted.types)
    text = f"has no topic '{topic}' ({wanted.types[0]})"
    if others:
        text += f"; of that type there is {', '.join(others)}: give {wanted.name}:={others[0]}"
    else:
        text += f" and no other of that type; it has {', '.join(sorted(bag.topics)) or 'no topics'}"
    return f"{text}; or give {wanted.instead}" if wanted.instead else text
