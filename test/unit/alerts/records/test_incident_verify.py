import sqlite3

import pytest

from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify


@pytest.fixture
def house(quick_disk, make_incident):
    with IncidentStore(quick_disk, wall=1.0) as store:
        for i in range(5):
            store.begin(make_incident(id=f"m{i}", wall=100.0 + i))
            store.record(f"m{i}", add=[Event(wall=1.0, kind="sensor", text=f"sensor {i}")])
            store.add_files(f"m{i}", [NewFile(name="best.jpg", role="best", data=b"jpeg%d" % i)])
            store.close(f"m{i}", wall=200.0 + i)
        store.amend("m1", wall=300.0, text="a neighbour")
        store.begin(make_incident(id="open"))
    return quick_disk


def check(folder, **given):
    with IncidentStore(folder, read_only=True) as store:
        return verify(store, **given)


def tamper(folder, *statements):
    with sqlite3.connect(folder / "incidents.sqlite") as connection:
        for statement in statements:
            connection.execute(statement)


def test_what_was_kept_fits(house):
    done = check(house)
    assert done.fits, done.problems
    assert (done.records, done.removed, done.open, done.files) == (5, 0, 1, 5)


@pytest.mark.parametrize(
    ("statements", "said"),
    [
        (["UPDATE links SET body=replace(body, 'sensor 2', 'sensor 9') WHERE incident='m2'"], "record of m2 (link 4)"),
        (["UPDATE links SET body=NULL WHERE incident='m2'"], "m2 (link 4) does not fit: its content is gone"),
        (["UPDATE links SET wall=0 WHERE incident='m2'"], "record of m2 (link 4) does not fit: its hash"),
        (["DELETE FROM links WHERE incident='m2'"], "record of m3 (link 5) does not fit: 1 link is missing before it"),
        (["DELETE FROM links WHERE n=(SELECT max(n) FROM links)"], "chain ends at link 6, but 7 were written"),
        (
            [
                "UPDATE links SET n=100 WHERE n=4",
                "UPDATE links SET n=4 WHERE n=5",
                "UPDATE links SET n=5 WHERE n=100",
            ],
            "record of m3 (link 4) does not fit: it does not follow",
        ),
        (["UPDATE incidents SET verdict='clear' WHERE id='m2'"], "m2 (link 4) does not fit: the list of incidents"),
        (["DELETE FROM incidents WHERE id='m2'"], "m2 (link 4) does not fit: it is missing in the list"),
        (
            ["UPDATE incidents SET id='made up', link=1 WHERE id='m2'"],
            "m2 (link 4) does not fit: it is missing in the list",
        ),
        (
            ["UPDATE links SET body=replace(body, 'neighbour', 'burglar') WHERE kind='amendment'"],
            "amendment of m1 (link 7)",
        ),
    ],
)
def test_the_first_record_that_does_not_fit_is_named(house, statements, said):
    tamper(house, *statements)
    done = check(house)
    assert said in done.problems[0]


def test_a_changed_or_lost_picture_is_named(house):
    (house / "incidents" / "m3" / "best.jpg").write_bytes(b"another")
    (house / "incidents" / "m4" / "best.jpg").unlink()
    done = check(house)
    assert "record of m3 (link 5) does not fit: the file best.jpg is not the one" in done.problems[0]
    assert "the file best.jpg cannot be read: No such file" in done.problems[1]
    assert check(house, files=False).fits


def test_a_chain_made_anew_is_found_by_a_hash_that_left_the_robot(house, make_incident):
    with IncidentStore(house, read_only=True) as store:
        known = store.link("m2").hash
    assert check(house, expect=known).fits
    for path in house.glob("incidents.sqlite*"):
        path.unlink()
    with IncidentStore(house, wall=1.0) as store:
        store.begin(make_incident(id="m0"))
        store.close("m0", wall=2.0)
    assert check(house).fits
    assert "this is not the chain that it came from" in check(house, expect=known).problems[0]


def test_removal_by_retention_fits_and_a_removal_by_hand_does_not(house):
    with IncidentStore(house) as store:
        store.remove("m1", wall=400.0, why="age")
    done = check(house)
    assert done.fits, done.problems
    assert (done.records, done.removed) == (4, 1)
    tamper(house, "DELETE FROM links WHERE kind='removal'")
    assert "record of m1 (link 3) does not fit: its content is gone" in check(house).problems[0]
