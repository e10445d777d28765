"""Sentences of the guard and of its checks, in the visitor's language.

The guard itself speaks English. What it often answers to people stands here as a pattern, so that the catalogue has its
translation; a sentence of another pattern is shown as it came.
"""

from __future__ import annotations

import re
from functools import lru_cache

from rosbot_patrol.console.words import Words, later

_PATTERNS = (
    # answers to orders
    later("the robot looks there, after the rooms that sensors call for"),
    later("the robot looks at the rooms {rooms}, those that sensors call for first"),
    later("nothing drives the robot: move_base does not run"),
    later("the guard is on a mission: give that up first"),
    later("the robot drives there, if there is a way"),
    later("the robot drives home"),
    later("given up: {rooms}; the robot drives home"),
    later("given up: {rooms}; the robot stays where it is"),
    later("the way home is given up"),
    later("there is nothing to give up"),
    later("the robot stands still until the stop is released"),
    later("released"),
    later("the emergency stop was not pressed"),
    later("the mode is {mode} already"),
    later("the mode is {mode} now, it was {before}; it guards in {n} s"),
    later("the mode is {mode} now, it was {before}"),
    later("the sensors of {room} start no mission until {time}"),
    later("the sensors of {room} count again"),
    later("the robot explores the house"),
    later("the robot explores already"),
    later("the robot has stopped exploring"),
    later("the robot does not explore"),
    later("{name}: taken after {n} s: {where}"),
    # people and codes
    later("the code is wrong"),
    later("the last tries were wrong: wait {n} s before the next one"),
    later("the password needs {n} to {most} characters"),
    later("the name needs 1 to 40 characters in one line"),
    later("the name '{name}' is taken"),
    later("the first one has to be an owner, who can then add others"),
    later("the code needs {n} to {most} digits"),
    later("the reason is missing"),
    # what is wrong in a form
    later("is empty, expected a name"),
    later("is '{name}', which {other} has already"),
    later("is {value}, expected at most {most}"),
    later("is {value}, expected at least {least}"),
    later("is {value}, expected a time of day such as 22:30"),
    later("expected either times of day (at) or an interval (every)"),
    later("is {value}, expected one line of text"),
    later("is {value}, expected a name of letters, digits, - and _"),
    later("expected a name of letters, digits, - and _"),
    later("holds no address that Apprise knows: see {link} for each service's"),
    later("lie on a line, expected the corners of an area"),
    later("{room} is still part of a mode or a round: take it out there first"),
    later("{room} is still watched by the motion sensor {n}: give that another room first"),
    later("the last change is not known any more"),
    # where a room's point may be
    later("the map shows no floor there; the nearest place for it is ({x}, {y})"),
    later("the map shows no floor there"),
    later(
        "it is {n} m from the nearest thing, and the robot needs {least} m to turn;"
        " the nearest place for it is ({x}, {y})"
    ),
    later("it is {n} m from the nearest thing, and the robot needs {least} m to turn"),
    later("no way leads there from {room} on this map"),
    later("{room} is there already"),
)  # fmt: skip


@lru_cache
def _compiled() -> tuple[tuple[str, re.Pattern[str]], ...]:
    return tuple((pattern, re.compile(_expression(pattern), re.DOTALL)) for pattern in _PATTERNS)


def _expression(pattern: str) -> str:
    parts = re.split(r"\{(\w+)\}", pattern)
    fixed, gaps = parts[::2], parts[1::2]
    pieces = (re.escape(text) + (f"(?P<{gaps[i]}>.+?)" if i < len(gaps) else "") for i, text in enumerate(fixed))
    return "".join(pieces) + r"\.?"


def told(text: str, _: Words) -> str:
    """A sentence of the guard in the visitor's language; as it came where its pattern is not known."""
    plain = text[:1].lower() + text[1:]
    for pattern, expression in _compiled():
        if (found := expression.fullmatch(plain)) is not None:
            shown = _(pattern).format(**found.groupdict())
            return shown + ("." if text.endswith(".") and not shown.endswith(".") else "")
    return _(text)
