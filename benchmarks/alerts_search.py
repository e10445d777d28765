"""100,000 incidents, as after years in a guarded house: time until a list or a search shows the newest fifty.

Each record has a dozen events and ten files, so that a body takes 4 kB. search_100k_ms is the slowest of the medians;
the files themselves are not made.
"""

from __future__ import annotations

import random
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from rosbot_patrol.alerts.records import chain
from rosbot_patrol.alerts.records.chain_file import format_line
from rosbot_patrol.alerts.records.files import CHAIN, FOLDER, RECORD
from rosbot_patrol.alerts.records.incident import Event, Incident, StoredFile, incident_to_plain
from rosbot_patrol.alerts.records.query import Query, find_incidents
from rosbot_patrol.alerts.records.repair import repair
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify

COUNT = 100_000
ROOMS = ("Küche", "hall", "square room behind the door", "west alcove", "台所", "corridor", "library", "bathroom")
START = 1_600_000_000.0
STEP = 1500.0  # time between incidents [s]
REPEATS = 31


def measure(count: int = COUNT) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        fill(Path(folder) / FOLDER, count)
        print(f"{count} incidents made in {time.perf_counter() - began:.0f} s, {size_mb(Path(folder)):.0f} MB")
        began = time.perf_counter()
        store = IncidentStore(Path(folder), wall=START)
        rebuilt = time.perf_counter() - began
        print(f"index made anew in {rebuilt:.1f} s, {store.path.stat().st_size / 1e6:.0f} MB")
        store.close_index()
        began = time.perf_counter()
        store = IncidentStore(Path(folder), wall=START)
        print(f"opened with a sound index in {time.perf_counter() - began:.2f} s")
        began = time.perf_counter()
        repair(store, wall=START)
        print(f"looked through for what a crash left in {time.perf_counter() - began:.2f} s")
        now = START + count * STEP
        middle = f"m{count // 2}"
        cases: dict[str, Callable[[], object]] = {
            "list": find(store),
            "list --room 3": find(store, room=3),
            "list --verdict confirmed": find(store, verdict="confirmed"),
            "list --room 3 --verdict unverified --since half": find(
                store, room=3, verdict="unverified", since=START + count * STEP / 2
            ),
            "list --since 90d": find(store, since=now - 90 * 86_400),
            "list --until half": find(store, until=START + count * STEP / 2),
            "search nobody (90,000 have it)": find(store, text="nobody"),
            "search nobody --since half": find(store, text="nobody", since=START + count * STEP / 2),
            "search nobody --until a month after the start": find(store, text="nobody", until=START + 30 * 86_400),
            "search kuche alcove (none has both)": find(store, text="kuche alcove"),
            "search person --room 5 --verdict confirmed": find(store, text="person", room=5, verdict="confirmed"),
            "search s (a letter, all have it)": find(store, text="s"),
            "search of a record's own word": find(store, text=f"word{count // 3}"),
            "one record": lambda: store.get(middle),
        }
        medians = {}
        print(f"{'':52}{'median ms':>10}{'worst ms':>10}{'found':>7}")
        for name, call in cases.items():
            times, found = timed(call)
            medians[name] = statistics.median(times)
            print(f"{name:52}{1000 * medians[name]:10.2f}{1000 * max(times):10.2f}{found:7}")
        slowest = 1000 * max(medians.values())
        print(f"search_100k_ms {slowest:.1f} (aim <= 20)")
        write = write_one(store)
        print(f"a record of twelve writes, each on the disk: {1000 * write:.1f} ms a write")
        began = time.perf_counter()
        done = verify(store, files=False)
        assert done.fits, done.problems
        print(f"verify without files: {time.perf_counter() - began:.1f} s")
        store.close_index()
    return {"search_100k_ms": round(slowest, 2)}


def fill(folder: Path, count: int) -> None:
    """Write the files of so many closed incidents."""
    dice = random.Random(1)
    links = [chain.make_link((0, chain.START), chain.BEGUN, "", START, chain.canonical({"wall": START}))]
    for number in range(count):
        incident = make(number, dice)
        text = chain.canonical(incident_to_plain(incident))
        (folder / incident.id).mkdir(parents=True)
        (folder / incident.id / RECORD).write_text(text, "utf-8")
        before = (links[-1].n, links[-1].hash)
        links.append(chain.make_link(before, chain.RECORD, incident.id, incident.closed or 0.0, text))
    (folder / CHAIN).write_bytes(b"".join(map(format_line, links)))


def make(number: int, dice: random.Random) -> Incident:
    verdict = dice.choices(("clear", "confirmed", "unverified", "unreachable"), (90, 4, 4, 2))[0]
    room = number % len(ROOMS)
    wall = START + number * STEP
    seen = f"person seen in room {room}" if verdict == "confirmed" else f"nobody seen in room {room}, turned once"
    events = tuple(Event(wall=wall + i, kind="state", text=f"driving to {ROOMS[room]}, step {i}") for i in range(12))
    files = tuple(StoredFile(name=f"look-{i}.jpg", role="look", sha256="0" * 64, size=40_000) for i in range(10))
    return Incident(
        id=f"m{number}",
        wall=wall,
        room_id=room,
        room_name=ROOMS[room],
        verdict=verdict,
        reason=f"{seen} word{number}",
        share_seen=dice.random(),
        closed=wall + 60.0,
        events=events,
        files=files,
    )


def find(store: IncidentStore, **given: object) -> Callable[[], object]:
    query = Query(**given)  # type: ignore[arg-type]
    return lambda: find_incidents(store.connection, store.path, query)


def timed(call: Callable[[], object]) -> tuple[list[float], int]:
    result = call()  # warms the cache, like a person's first question
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return times, len(result) if isinstance(result, list) else int(result is not None)


def write_one(store: IncidentStore) -> float:
    """Seconds of one write of a record on this disk."""
    began = time.perf_counter()
    store.begin(Incident(id="timed", wall=START, room_id=1, room_name="hall"))
    for i in range(10):
        store.record("timed", add=[Event(wall=START, kind="state", text=f"event {i}")])
    store.close("timed", wall=START, verdict="clear")
    return (time.perf_counter() - began) / 12


def size_mb(folder: Path) -> float:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6
