"""Common parts of all replays: a node's inputs, and a bag fed to it on the bag's own clock."""

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
        name: the node's name for it.
        topic: default topic of the bag, "" for the name.
        types: accepted message types, in ROS 1's spelling.
        is_needed: nothing can be replayed without it.
        instead: hint at an alternative, for the error about a missing needed input.
    """

    name: str
    topic: str = ""
    types: tuple[str, ...]
    is_needed: bool = True
    instead: str = ""


class Replay(Protocol):
    """A node's core and the node's code around it."""

    @property
    def inputs(self) -> Sequence[Input]:
        """Inputs of the node."""

    @property
    def kinds(self) -> Mapping[str, Kind]:
        """Conversions of its input messages, by their types."""

    def begin(self, names: Collection[str]) -> None:
        """Take the names of the inputs that will be heard, before the first record."""

    def hear(self, name: str, now: float, content: Any) -> None:
        """Process a record of the named input, recorded at a time [s]."""

    def finish(self) -> Result:
        """The result."""


def run_replay(
    bag: Bag,
    replay: Replay,
    *,
    remaps: Mapping[str, str] | None = None,
    progress: Callable[[float], None] = lambda _share: None,
) -> Result:
    """Feed a whole bag to a replay.

    Args:
        bag: an open bag.
        replay: replay of a node.
        remaps: topics of the bag by the names of the inputs, if they differ.
        progress: called with the share done, after each record.

    Raises:
        BagError: a needed topic is missing or of another type, or the bag is broken.
    """
    names = chosen_topics(bag, replay.inputs, remaps or {})
    replay.begin(names.values())
    for record in bag.records(names, replay.kinds):
        replay.hear(names[record.topic], record.time, record.content)
        progress(bag.done)
    return replay.finish()


def chosen_topics(bag: Bag, inputs: Sequence[Input], remaps: Mapping[str, str]) -> dict[str, str]:
    """Choose the bag's topics for the inputs; returns the inputs' names by topic.

    Raises:
        BagError: a topic is missing or of another type; the text lists the candidates.
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
