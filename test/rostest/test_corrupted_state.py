"""The state folder with damaged files, drawn from seeds: patrol and sensor_watch start, guard, and say what is damaged.

In the suite there are a few seeds. All of them, with a table:

    . scripts/env; .ws/venv/bin/python -m pytest -s -m long test/rostest/test_corrupted_state.py
"""

from __future__ import annotations

import random
import shutil
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest
from patrol_house import ROOT, stop, wait_until

rospy = pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

SEEDS = 200
PICTURES = (".jpg", ".png")
UNIMPORTANT = (  # nothing is lost with these, and so nothing needs to be told
    "alive", "patrol.lock", "calls.mark", "incidents.reserve", "index.sqlite", "index.sqlite-wal", "index.sqlite-shm",
    "report.html",
)  # fmt: skip


def emptied(path: Path, _: random.Random) -> None:
    path.write_bytes(b"")


def cut(path: Path, rng: random.Random) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: rng.randrange(max(len(data), 1))])


def flipped(path: Path, rng: random.Random) -> None:
    data = bytearray(path.read_bytes())
    for _ in range(min(rng.randint(1, 8), len(data))):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(bytes(data))


def zeros(path: Path, rng: random.Random) -> None:
    """As after a power cut: the length is right, and the end has never been written."""
    data = path.read_bytes()
    keep = rng.randrange(max(len(data), 1))
    path.write_bytes(data[:keep] + bytes(len(data) - keep))


def noise(path: Path, rng: random.Random) -> None:
    path.write_bytes(rng.randbytes(rng.randint(1, 5000)))


def doubled(path: Path, _: random.Random) -> None:
    path.write_bytes(path.read_bytes() * 2)


def gone(path: Path, _: random.Random) -> None:
    path.unlink()


def a_folder(path: Path, _: random.Random) -> None:
    path.unlink()
    path.mkdir()


DAMAGES: tuple[Callable[[Path, random.Random], None], ...] = (
    emptied, cut, flipped, zeros, noise, doubled, gone, a_folder,
)  # fmt: skip


@dataclass
class Outcome:
    """What became of a damaged folder.

    Attributes:
        damage: what was done to which files.
        problem: what is wrong with the guard, "" if it guards.
        told: whether the logs name a damaged file, or say that something is damaged.
    """

    damage: list[tuple[str, str]]
    problem: str
    told: bool

    @property
    def is_important(self) -> bool:
        return any(not name.endswith((*UNIMPORTANT, *PICTURES)) for _, name in self.damage)


def corrupt(state: Path, rng: random.Random) -> list[tuple[str, str]]:
    """Damage one to three files; pictures of incidents less often than other files."""
    files = sorted(path for path in state.rglob("*") if path.is_file())
    weights = [0.05 if path.suffix in PICTURES else 1.0 for path in files]
    done = []
    for path in dict.fromkeys(rng.choices(files, weights, k=rng.randint(1, 3))):
        damage = rng.choice(DAMAGES)
        damage(path, rng)
        done.append((damage.__name__, str(path.relative_to(state))))
    return done


def make_state(house) -> Path:
    """A folder after a night: two incidents, a notice that was sent, a mode, calls."""
    from rosbot_patrol.srv import Arm

    state = house.folder / "night"
    place = house.folder / "mail_of_the_night"
    house.start_patrol(state_dir=str(state), maildir=str(place))
    for count, verdict in ((1, "confirmed"), (2, "clear")):
        house.person = verdict == "confirmed"
        house.send(2)
        assert house.wait_for_mission(count).last_verdict == verdict
    rospy.ServiceProxy("/patrol/arm", Arm)("away")
    stop(house.patrol)
    return state


def guard(house, state: Path, name: str) -> tuple[str, str]:
    """Start both nodes on a folder, and report motion; returns what is wrong, and what they said."""
    mail = house.folder / f"mail_{name}"
    house.person = False
    watch_params = {"path_to_params": str(ROOT / "params" / "room_points.yaml"), "state_dir": str(state)}
    watch = house._start(
        ["rosrun", "rosbot_patrol", "sensor_watch"],
        {**watch_params, "transport": "maildir", "maildir": str(mail), "mail_interval": 0},
    )
    problem = ""
    try:
        house.start_patrol(state_dir=str(state), maildir=str(mail), evidence_after=0.5)
        house.person = True
        house.send(3)
        wait_until(lambda: any(a.kind == "seen" and a.room_id == 3 for a in house.alerts), 40, "the alert")
        wait_until(lambda: any("image/jpeg" in text for text in mails(mail)), 20, "the mail with a picture")
    except AssertionError as err:
        problem = str(err).splitlines()[0][:300]
    said = house.log(house.patrol) + house.log(watch)
    for process, node in ((house.patrol, "the patrol"), (watch, "sensor_watch")):
        if process.poll() is not None:
            problem += f" {node} has ended with {process.returncode}."
    if "Traceback" in said:
        problem += " A traceback: " + said[said.index("Traceback") :][-600:]
    stop(watch)
    stop(house.patrol)
    house.alerts.clear()
    return problem, said


def mails(folder: Path) -> list[str]:
    return [path.read_text(errors="replace") for path in (folder / "new").glob("*")]


def play(house, seeds: Iterable[int]) -> list[Outcome]:
    house.start_move_base()
    night = make_state(house)
    outcomes = []
    for seed in seeds:
        state = house.folder / f"state_{seed}"
        shutil.copytree(night, state)
        damage = corrupt(state, random.Random(seed))
        problem, said = guard(house, state, str(seed))
        names = {Path(name).name for _, name in damage}
        told = any(name in said for name in names) or "damaged" in said
        outcomes.append(Outcome(damage, problem, told))
        shutil.rmtree(state)
        print(seed, damage, "told" if told else "", problem, flush=True)
    return outcomes


@pytest.mark.long
def test_a_damaged_state_folder_is_told_and_the_guard_guards(house):
    outcomes = play(house, range(3))
    assert not [each for each in outcomes if each.problem]


@pytest.mark.long
def test_two_hundred_damaged_state_folders(house):
    outcomes = play(house, range(SEEDS))
    kinds = Counter((damage, Path(name).name) for each in outcomes for damage, name in each.damage)
    important = [each for each in outcomes if each.is_important]
    print(f"\n{len(outcomes)} folders, {kinds.total()} damaged files of {len(kinds)} kinds")
    print(f"guards: {sum(not each.problem for each in outcomes)}")
    print(f"told where something may be lost: {sum(each.told for each in important)} of {len(important)}")
    assert not [each for each in outcomes if each.problem]
