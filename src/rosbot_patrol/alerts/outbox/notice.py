"""What the owner is told: one record, whatever it travels by, and its form on disk.

A notice says what happened in plain values; each channel makes of it what it sends (a mail, a JSON document). On disk
it is one JSON document, so that one written today can leave tomorrow by a channel that did not exist yet.
"""

from __future__ import annotations

import base64
import binascii
import json
import re
import zlib
from dataclasses import dataclass
from typing import Any

FORMAT = 1
_ID = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._+-]{0,149}")

URGENT = ("incident", "test")  # kinds that are never merged into a digest, nor held up by other kinds


class LaterFormat(ValueError):
    """A notice that a later version of this program wrote."""


@dataclass(frozen=True, kw_only=True)
class Notice:
    """One thing that the owner is told.

    Attributes:
        id: unlike any other's; letters, digits, dots, dashes: it becomes a file's name and a Message-ID.
        wall: when it happened, seconds since 1970.
        kind: "incident", "verdict", "sensor", "fault", "digest", "test", ...; channels may ask for some of them only.
        subject: one line.
        text: paragraphs, for people.
        facts: (name, value) pairs shown as a table below the text.
        room_id, room_name: where, else the room that it is about; -1 and "" for nowhere.
        place: description for people, if `room_name` does not say it; otherwise "".
        called_id, called_name: the room that called, if it is another one; otherwise -1 and "".
        verdict: of the mission; "" for none.
        incident: id of its record; "" for none.
        picture: JPEG, None if there is none.
        picture_name: file name of it.
        channels: names of those that are asked; empty for all that take its kind.
        link: web address of the page about it; "" for none.
        seen_link: web address that marks its incident as seen by POST; "" for none.

    Raises:
        ValueError: an id that is none.
    """

    id: str
    wall: float
    kind: str
    subject: str
    text: str
    facts: tuple[tuple[str, str], ...] = ()
    room_id: int = -1
    room_name: str = ""
    place: str = ""
    called_id: int = -1
    called_name: str = ""
    verdict: str = ""
    incident: str = ""
    picture: bytes | None = None
    picture_name: str = "picture.jpg"
    channels: tuple[str, ...] = ()
    link: str = ""
    seen_link: str = ""

    def __post_init__(self) -> None:
        if not _ID.fullmatch(self.id):
            raise ValueError(f"'{self.id}' is no id of a notice: expected letters, digits, dots and dashes")

    @property
    def is_urgent(self) -> bool:
        """Whether it leaves as a message of its own, as soon as it can."""
        return self.kind in URGENT

    def to_bytes(self) -> bytes:
        """The notice in its form on disk."""
        tree = {"format": FORMAT, **{name: getattr(self, name) for name in _TEXTS}}
        tree |= {"wall": self.wall, "room_id": self.room_id, "facts": self.facts, "channels": self.channels}
        if self.called_id >= 0:
            tree |= {"called_id": self.called_id, "called_name": self.called_name}
        if self.place:
            tree["place"] = self.place
        tree |= {name: value for name in _LINKS if (value := getattr(self, name))}
        if self.picture is not None:
            tree["picture"] = base64.b64encode(self.picture).decode("ascii")
        tree["check"] = _check(tree)
        return json.dumps(tree, indent=1).encode("ascii")

    @classmethod
    def from_bytes(cls, data: bytes) -> Notice:
        """The notice that `to_bytes` gave.

        Raises:
            ValueError: it is none, or a damaged one; says so.
            LaterFormat: it is one of a later version of this program.
        """
        try:
            tree = json.loads(data)
        except (ValueError, RecursionError) as err:
            raise ValueError(f"is no notice: {err}") from err
        if not isinstance(tree, dict) or not isinstance(tree.get("format"), int):
            raise ValueError("is no notice: it has no format number")
        if tree["format"] > FORMAT:
            raise LaterFormat(f"is of format {tree['format']}, this version knows up to {FORMAT}")
        check = tree.pop("check", None)  # notices of 1.0.0 have none
        if check is not None and check != _check(tree):
            raise ValueError("is no notice: it was damaged, its checksum does not fit")
        try:
            return cls._from_tree(tree)
        except (KeyError, TypeError, ValueError) as err:
            raise ValueError(f"is no notice: {err!r}") from err

    @classmethod
    def _from_tree(cls, tree: dict[str, Any]) -> Notice:
        texts = {name: tree[name] for name in _TEXTS}
        for name, value in texts.items():
            if not isinstance(value, str):
                raise TypeError(f"{name} is no text")
        picture = tree.get("picture")
        try:
            data = None if picture is None else base64.b64decode(picture, validate=True)
        except binascii.Error as err:
            raise ValueError(f"picture: {err}") from err
        return cls(
            wall=float(tree["wall"]),
            room_id=int(tree["room_id"]),
            called_id=int(tree.get("called_id", -1)),
            called_name=str(tree.get("called_name", "")),
            place=str(tree.get("place", "")),
            facts=tuple((str(name), str(value)) for name, value in tree["facts"]),
            channels=tuple(map(str, tree["channels"])),
            picture=data,
            **{name: str(tree.get(name, "")) for name in _LINKS},
            **texts,
        )


def _check(tree: dict[str, Any]) -> str:
    """A checksum of a notice's content, whatever form its JSON has."""
    return f"{zlib.crc32(json.dumps(tree, sort_keys=True).encode()):08x}"


_LINKS = ("link", "seen_link")
_TEXTS = ("id", "kind", "subject", "text", "room_name", "verdict", "incident", "picture_name")
