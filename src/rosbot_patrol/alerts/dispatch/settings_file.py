"""Channel settings of each program that uses an outbox, left beside the notices without passwords.

`rosrun rosbot_patrol notify` reads them to try the same channels as the robot. The programs compare theirs, since one
of them delivers for all.
"""

from __future__ import annotations

import logging
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.safe_text import token
from rosbot_patrol.errors import ParamError, StateError
from rosbot_patrol.files import read_json, write_json
from rosbot_patrol.params import load

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of one program.

    Attributes:
        who: name of the program.
        pid: its process.
        wall: time of its start, seconds since 1970.
        mail: its channels.
    """

    who: str
    pid: int
    wall: float
    mail: MailParams

    @property
    def is_running(self) -> bool:
        """Whether its process exists."""
        return Path(f"/proc/{self.pid}").exists()


def write_settings(folder: Path, settings: Settings) -> None:
    """Write the settings into the outbox. Raises OSError."""
    tree = {"who": settings.who, "pid": settings.pid, "wall": settings.wall, "mail": asdict(settings.mail)}
    write_json(folder / f"settings-{token(settings.who)}.json", tree)


def read_settings(folder: Path) -> list[Settings]:
    """Settings of all programs, the latest start first; a file that makes no sense is left out and logged."""
    found = []
    for path in folder.glob("settings-*.json"):
        try:
            tree = read_json(path) or {}
            mail = load(MailParams, tree["mail"], name=f"{path}: mail/")
            found.append(Settings(who=str(tree["who"]), pid=int(tree["pid"]), wall=float(tree["wall"]), mail=mail))
        except (StateError, ValueError, KeyError, TypeError, ParamError) as err:
            log.warning("%s cannot be used: %s", path, err)
    return sorted(found, key=lambda settings: -settings.wall)


def differences(folder: Path, who: str, mail: MailParams) -> list[str]:
    """A sentence for each running program with other channels than this one."""
    sentences = []
    for other in read_settings(folder):
        if other.who == who or other.pid == os.getpid() or not other.is_running:
            continue
        mine, theirs = asdict(mail), asdict(other.mail)
        names = [name for name in mine if mine[name] != theirs[name] and name != "notify_verdicts"]
        if names:
            sentences.append(f"{other.who} has other values than {who} for {', '.join(names)}: one delivers for both")
    return sentences
