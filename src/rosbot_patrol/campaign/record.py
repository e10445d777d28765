"""Results of the patrols: one JSON file each, written atomically, so that a campaign can be resumed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from rosbot_patrol.campaign.plan import CONFIRMED
from rosbot_patrol.counts import count_of
from rosbot_patrol.errors import ParamError, StateError
from rosbot_patrol.files import read_json, write_json

RESULT, PLAN, SETTINGS = "result.json", "patrol.json", "campaign.json"
BESIDE = 1.0  # error of a notified position above which it refers to nobody [m]


@dataclass(frozen=True, kw_only=True)
class Result:
    """Result of one patrol, and the ground truth; None is unknown.

    Attributes:
        verdict: of the mission to the room, "" for none; reason: its sentence.
        problem: reason why the patrol was not completed, "" if it was.
        was_there: whether somebody was in the room or in view before the verdict, long enough to be found, or found.
        in_room, in_view: durations [s]; views: number of images that could show somebody.
        place_error: distance of the notified position from the true one [m].
        share_told, share_true: of the room's floor that was seen.
        share_first: of it told at the end of the first viewpoint; viewpoints: number of them.
        unseen: shares of the floor that were not seen, by the reason.
        way: length of the robot's shortest path to the room's point [m].
        times: seconds of simulated time between two events, by name.
        contacts: objects that the robot touched; touches: each touch in words, with its time and who moved.
        localisation: mean and largest error of the pose [m].
        home_error: final distance from the robot's start [m].
        home: whether it came back; None if it went on to another room, or unknown.
        suspects: objects that the guard reports as person-like.
        mishap: the fault, "" for none; allowed: verdicts that it excuses.
        people: persons to be found; shown: number of them that the camera had in view for long enough before the
            look-around was over, 0 for unknown.
        mails: delivered mails of the mission to the room; missions: number that ended.
        sim_s, wall_s: duration.
    """

    number: int
    seed: int
    kind: str
    house: str
    room: int
    title: str
    expected: str
    verdict: str = ""
    reason: str = ""
    problem: str = ""
    was_there: bool = False
    in_room: float = 0.0
    in_view: float = 0.0
    place_error: float | None = None
    share_told: float | None = None
    share_true: float | None = None
    share_first: float | None = None
    viewpoints: int = 0
    unseen: dict[str, float] = field(default_factory=dict)
    way: float | None = None
    times: dict[str, float] = field(default_factory=dict)
    contacts: list[str] = field(default_factory=list)
    touches: list[str] = field(default_factory=list)
    localisation: tuple[float, float] | None = None
    home_error: float | None = None
    home: bool | None = None
    suspects: list[str] = field(default_factory=list)
    mishap: str = ""
    allowed: tuple[str, ...] = ()
    people: int = 1
    shown: int = 0
    mails: int = 0
    missions: int = 0
    sim_s: float = 0.0
    wall_s: float = 0.0

    @property
    def detected(self) -> bool | None:
        """Whether a present person was found; None if nobody was there."""
        return self.verdict == CONFIRMED if self.was_there else None

    @property
    def missed(self) -> bool:
        """Whether a present person was not found, without an excusing fault."""
        return self.detected is False and self.verdict not in self.allowed

    @property
    def false_alarm(self) -> bool:
        """Whether the guard found somebody although nobody was there."""
        return self.verdict == CONFIRMED and not self.was_there

    @property
    def is_elsewhere(self) -> bool:
        """Whether somebody was there, but the notice names a place where nobody was."""
        return self.verdict == CONFIRMED and self.place_error is not None and self.place_error > BESIDE

    @property
    def has_its_mails(self) -> bool:
        """Whether each person whom the camera could see, unless it broke, made a mail, and none made two."""
        fewest = 1 if self.mishap else max(self.shown, 1)
        return fewest <= self.mails <= max(self.people, 1)

    @property
    def failures(self) -> tuple[str, ...]:
        """Deviations from the expected outcome, each in a few words."""
        found = [self.problem] if self.problem else []
        found += ["missed"] if self.missed else []
        found += ["false alarm"] if self.false_alarm else []
        found += [f"told {self.place_error:.1f} m from anybody"] if self.is_elsewhere else []
        is_right = self.verdict in ("clear", *self.allowed)
        if not (self.missed or self.false_alarm or self.problem) and not self.was_there and not is_right:
            found.append(f"{self.verdict or 'no verdict'} in a room without anybody")
        if self.verdict == CONFIRMED and not self.has_its_mails:
            in_view = f" for {self.shown} people in view" if self.mails < self.shown > 1 else ""
            found.append(count_of(self.mails, "mail") + in_view)
        touched = self.touches or sorted(set(self.contacts))
        found += [f"touched {'; '.join(touched)}"] if self.contacts else []
        found += ["not home"] if self.home is False else []
        return tuple(found)

    def to_json(self) -> str:
        """Text for the file."""
        return json.dumps(asdict(self), indent=1, ensure_ascii=False)


def result_from_plain(tree: Mapping[str, Any]) -> Result:
    """Result from the contents of its file; fields of newer versions are ignored.

    Raises:
        TypeError: a field is missing.
    """
    known = {f.name for f in fields(Result)}
    kept = {key: value for key, value in tree.items() if key in known}
    kept["allowed"] = tuple(kept.get("allowed", ()))
    if kept.get("localisation"):
        kept["localisation"] = tuple(kept["localisation"])
    return Result(**kept)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a folder's campaign; another campaign needs another folder.

    Attributes:
        faults: every how many patrols something breaks, 0 for never.
        generated: number of drawn houses; world: file of a strange world. Without either, our own houses.
    """

    seed: int
    houses: tuple[str, ...]
    kind: str = "patrols"
    faults: int = 0
    network: str = "house"
    figures: str = "plain"
    hardware: bool = False
    generated: int = 0
    world: str = ""

    @property
    def is_own(self) -> bool:
        """Whether it plays in our own houses."""
        return not self.generated and not self.world

    @property
    def mix(self) -> str:
        """Mix of the kinds of patrols, of `plan.MIXES`."""
        return "usual" if self.is_own else "half_empty"


_LATER: dict[str, Any] = {
    "faults": 0,
    "network": "house",
    "figures": "plain",
    "hardware": False,
    "generated": 0,
    "world": "",
}
"""Settings that folders of earlier campaigns lack, as those ran."""
_EVERY_OTHER = 2  # folders of earlier campaigns say True


class CampaignFolder:
    """The files of a campaign.

    Args:
        folder: created if it is missing.
        settings: of the campaign; must equal those of the folder's start.

    Raises:
        ParamError: the folder holds another campaign, or its file cannot be read.
        OSError: the folder cannot be made.
    """

    def __init__(self, folder: Path, settings: Settings) -> None:
        self.folder = folder
        self.settings = settings
        path = folder / SETTINGS
        begun = _read(path)
        if begun is not None and begun.get("faults") is True:
            begun["faults"] = _EVERY_OTHER
        now = json.loads(json.dumps(asdict(settings)))
        if begun is None:
            write_json(path, now)
        elif (begun := {**_LATER, **begun}) != now:
            differs = ", ".join(f"{k} {begun.get(k)}, not {v}" for k, v in now.items() if begun.get(k) != v)
            raise ParamError(str(folder), f"holds a campaign of another kind ({differs}): name another folder")

    def of(self, number: int) -> Path:
        """Folder of a patrol."""
        return self.folder / f"{number:04d}"

    def result(self, number: int) -> Result | None:
        """Result of a patrol, None if it has not been run."""
        return _result(self.of(number) / RESULT)

    def results(self) -> list[Result]:
        """Results of all patrols run so far, in order."""
        return _results(self.folder)


def results_in(folder: Path) -> list[Result]:
    """Results in the folder of any campaign.

    Raises:
        ParamError: it holds none.
    """
    settings = _read(folder / SETTINGS)
    if settings is None:
        raise ParamError(str(folder), f"holds no campaign (there is no {SETTINGS})")
    found = _results(folder)
    if not found:
        raise ParamError(str(folder), "holds a campaign without any result")
    return found


def _results(folder: Path) -> list[Result]:
    paths = sorted(folder.glob(f"[0-9]*/{RESULT}"), key=lambda path: int(path.parent.name))
    return [result for path in paths if (result := _result(path)) is not None]


def _result(path: Path) -> Result | None:
    tree = _read(path)
    if tree is None:
        return None
    try:
        return result_from_plain(tree)
    except TypeError as err:
        raise ParamError(str(path), f"is no result ({err}): remove it") from err


def _read(path: Path) -> dict[str, Any] | None:
    try:
        return read_json(path)
    except StateError as err:
        raise ParamError(str(path), f"{err.problem}: remove it") from err
