"""Texts for the owner about motion sensors and the ROS graph: what is wrong, since when, and what to do."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from rosbot_patrol.counts import count_of
from rosbot_patrol.sensors.problems import OF_GRAPH, Kind, duration

MAX_LISTED = 20  # of one kind in one notice

_ONE_IS: dict[Kind, str] = {
    Kind.PATROL_GONE: "has gone, or hangs",
    Kind.MASTER_GONE: "has gone, or was started anew",
    Kind.SECOND_DRIVER: "has a second publisher",
    Kind.SECOND_WITNESS: "has a second publisher",
    Kind.STRANGE_NODE: "runs on a machine that the guard does not know",
    Kind.LINK_GONE: "has gone",
    Kind.SETTINGS_CHANGED: "has other settings than at its start",
    Kind.SILENT: "is silent",
    Kind.BRIDGE_GONE: "has gone",
    Kind.DUPLICATE_ID: "is reported by two at a time",
    Kind.WRONG_PEER: "speaks from an address that is not its own",
    Kind.NEW_ADDRESS: "speaks from another address than before",
    Kind.FLAPPING: "comes and goes",
    Kind.STUCK_ON: "reports motion without an end",
    Kind.NO_MOTION: "has seen no motion for very long",
    Kind.UNKNOWN_ID: "is not known",
    Kind.CLOCK_OFF: "has a clock that is far off",
}
_TO_DO: dict[Kind, str] = {
    Kind.PATROL_GONE: "where it has ended, it is started again by itself within seconds, and takes up what it was at."
    " Where it has not come back by now, look at the robot, at its log and at its disk, and start it anew.",
    Kind.MASTER_GONE: "start the guard anew: its programs go on for now, but none that ends comes back. As a service"
    " (scripts/install-service) it does so by itself.",
    Kind.SECOND_DRIVER: "where you drive with a program of your own, end it. Otherwise somebody in your network drives"
    " the robot: press the emergency stop, take the robot off the network, and close the graph with scripts/secure"
    " (docs/security.md).",
    Kind.SECOND_WITNESS: "where you play a record or try a program of your own, end it. Otherwise somebody in your"
    " network tells the guard what it sees, and may hide an intruder: take the robot off the network, and close the"
    " graph with scripts/secure (docs/security.md).",
    Kind.STRANGE_NODE: "if the machine is yours, name it in graph_hosts. Otherwise somebody in your network is in the"
    " guard's graph and can command it: take the robot off the network, and close the graph with scripts/secure"
    " (docs/security.md).",
    Kind.LINK_GONE: "look at the device, its cable and the log of the program that served it. Where both are well,"
    " somebody may have cut the link through the network: scripts/secure closes the graph (docs/security.md).",
    Kind.SETTINGS_CHANGED: "where nobody of yours has changed them, somebody in your network has, and the program takes"
    " them at its next start: start the guard anew, and close the graph with scripts/secure (docs/security.md).",
    Kind.SILENT: "see that it has power and Wi-Fi, and switch it off and on. Until it is heard again, nobody notices"
    " motion in its room.",
    Kind.BRIDGE_GONE: "it is started again by itself within seconds. Where it is not, look at the machine that it runs"
    " on, at its network and at its log. Sensors that report through it are not heard.",
    Kind.DUPLICATE_ID: "two devices have one id, or somebody imitates a sensor. Find both by their addresses, and give"
    " one another id. A key for each sensor shuts imitators out (docs/sensors.md, Security).",
    Kind.WRONG_PEER: "where it has a new address, correct 'peers' in the file of sensors. Otherwise somebody imitates"
    " it.",
    Kind.NEW_ADDRESS: "a router gives new addresses at times; then nothing is to do. Otherwise another device imitates"
    " the sensor. A key for each sensor ends both (docs/sensors.md, Keys).",
    Kind.FLAPPING: "a sensor's Wi-Fi is weak, or its power supply is: bring it nearer to the access point, and try"
    " another supply. A bridge that comes and goes is restarted again and again: its log says why.",
    Kind.STUCK_ON: "where nobody was there, something warm moves before it (heating, curtain, sun), its supply is"
    " noisy, or it is broken. Turn both of its potentiometers to the left; replace it.",
    Kind.NO_MOTION: "walk past it and see whether it reports. It may be covered, turned away, or its output stuck.",
    Kind.UNKNOWN_ID: "add it to the file of sensors, or correct the id in its firmware. If it is none of yours,"
    " somebody reports motion on your network. The robot does not answer it.",
    Kind.CLOCK_OFF: "let both machines set their clocks by NTP. A sensor takes its time from the bridge: restart it.",
}
_MANY_SILENT = (
    "So many at a time: look at the Wi-Fi (access point, router) and at the power before the sensors. Somebody may also"
    " have cut or jammed them."
)


@dataclass(frozen=True, kw_only=True)
class Item:
    """One item of a notice.

    Attributes:
        kind: of the problem; None: all is well again.
        title: name of the sensor or bridge; what: the words that follow it.
        since: begin, seconds since 1970; lasted: how long [s].
        is_of_graph: it is, or was, a problem of the ROS graph.
    """

    kind: Kind | None
    title: str
    what: str
    since: float
    lasted: float
    is_of_graph: bool = False


def subject(items: Sequence[Item]) -> str:
    """One line for all items."""
    wrong = [item for item in items if item.kind is not None]
    well = [item for item in items if item.kind is None]
    parts = []
    kinds = {item.kind for item in wrong}
    if len(wrong) == 1 and wrong[0].kind is not None:
        parts.append(f"{wrong[0].title} {_ONE_IS[wrong[0].kind]}")
    elif kinds == {Kind.SILENT}:
        parts.append(f"{len(wrong)} motion sensors are silent")
    elif Kind.PATROL_GONE in kinds:
        gone = next(item for item in wrong if item.kind is Kind.PATROL_GONE)
        parts.append(
            f"{gone.title} {_ONE_IS[Kind.PATROL_GONE]}, and {count_of(len(wrong) - 1, 'more is', 'more are')} not well"
        )
    elif wrong:
        what = "the guard's network" if kinds <= OF_GRAPH else "the motion sensors"
        parts.append(f"{len(wrong)} things are wrong with {what}")
    if len(well) == 1:
        parts.append(f"{well[0].title} is well again")
    elif well:
        what = "things" if any(item.is_of_graph for item in well) else "motion sensors"
        parts.append(f"{len(well)} {what} are well again")
    return "rosbot patrol: " + ", ".join(parts)


def text(items: Sequence[Item], *, watched: int, well: int) -> str:
    """The whole notice.

    Args:
        items: of the notice.
        watched: how many sensors are watched.
        well: how many of them are well.
    """
    blocks = []
    for kind in Kind:
        of_kind = [item for item in items if item.kind is kind]
        if of_kind:
            lines = [_line(item) for item in of_kind[:MAX_LISTED]] + _rest(len(of_kind))
            lines.append(f"What to do: {_TO_DO[kind]}")
            if kind is Kind.SILENT and len(of_kind) >= 3 and 2 * len(of_kind) >= watched:
                lines.append(_MANY_SILENT)
            blocks.append(lines)
    back = [item for item in items if item.kind is None]
    if back:
        blocks.append([_line(item) for item in back[:MAX_LISTED]] + _rest(len(back)))
    blocks.append([f"{well} of {count_of(watched, 'motion sensor is', 'motion sensors are')} well."])
    return "\n\n".join("\n".join(lines) for lines in blocks) + "\n"


def _rest(count: int) -> list[str]:
    return [f"- and {count - MAX_LISTED} more"] if count > MAX_LISTED else []


def _line(item: Item) -> str:
    since = time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(item.since))
    title = item.title[:1].upper() + item.title[1:]
    if item.kind is None:
        return f"- {title} is well again: {item.what}, from {since}, for {duration(item.lasted)}."
    if item.kind is Kind.SILENT and "start" not in item.what:
        return f"- {title} {item.what}. Last heard {since}, {duration(item.lasted)} ago."
    return f"- {title} {item.what}. Since {since} ({duration(item.lasted)})."


def short(kinds: Sequence[Kind]) -> str:
    """Problems in a few words: "it was silent, it came and went"."""
    was = {
        Kind.PATROL_GONE: "it was gone",
        Kind.MASTER_GONE: "it was gone",
        Kind.SECOND_DRIVER: "it had a second publisher",
        Kind.SECOND_WITNESS: "it had a second publisher",
        Kind.STRANGE_NODE: "it was there",
        Kind.LINK_GONE: "it was gone",
        Kind.SETTINGS_CHANGED: "it had other settings",
        Kind.SILENT: "it was silent",
        Kind.BRIDGE_GONE: "it was gone",
        Kind.DUPLICATE_ID: "two reported its id",
        Kind.WRONG_PEER: "it spoke from a wrong address",
        Kind.NEW_ADDRESS: "it had a new address",
        Kind.FLAPPING: "it came and went",
        Kind.STUCK_ON: "it reported motion without an end",
        Kind.NO_MOTION: "it saw no motion",
        Kind.UNKNOWN_ID: "it is heard no more",
        Kind.CLOCK_OFF: "its clock was off",
    }
    return ", ".join(was[kind] for kind in kinds)
