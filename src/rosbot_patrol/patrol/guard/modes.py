"""Names of the arming modes, and what people type for them.

A hint never turns arming into disarming or the other way: if a name is as close to both, all names are listed instead.
"""

from __future__ import annotations

import difflib
import re

from rosbot_patrol.alerts.safe_text import one_line

DISARMED = "disarmed"
MODES = ("armed_away", "armed_home", "night", DISARMED)

_ALIASES = {"armed": "armed_away"}
_MEANT = {
    "arm": "armed_away",
    "away": "armed_away",
    "on": "armed_away",
    "guard": "armed_away",
    "home": "armed_home",
    "stay": "armed_home",
    "disarm": DISARMED,
    "off": DISARMED,
    "unarmed": DISARMED,
    "unarm": DISARMED,
}
_LONGEST = 40  # length of a name shown in a message
_NEAR = 0.6  # similarity above which a name is taken for a typing error
_APART = 0.15  # minimum lead over the similarity to any opposite name


def parse_mode(name: str) -> str | None:
    """One of MODES for a name in any case, with blanks or hyphens; None for any other name."""
    plain = _plain(name)
    plain = _ALIASES.get(plain, plain)
    return plain if plain in MODES else None


def unknown_mode(name: str) -> str:
    """Message for a name that is no mode."""
    meant = _meant(_plain(name))
    hint = f"did you mean '{meant}'?" if meant else f"expected one of {', '.join(MODES)}"
    return f"'{one_line(name)[:_LONGEST]}' is not known here, {hint}"


def _plain(name: str) -> str:
    return re.sub(r"[\s_-]+", "_", name.strip().casefold()).strip("_")


def _meant(plain: str) -> str:
    """The mode that was meant, "" if that is uncertain."""
    if plain in _MEANT:
        return _MEANT[plain]
    words = {name: name for name in MODES} | _ALIASES
    likeness = {word: difflib.SequenceMatcher(None, plain, word).ratio() for word in words}
    best = max(likeness, key=lambda word: likeness[word])
    mode = words[best]
    opposite = max(likeness[word] for word in words if (words[word] == DISARMED) != (mode == DISARMED))
    return mode if likeness[best] >= max(_NEAR, opposite + _APART) else ""
