import shutil
import sqlite3

import pytest

from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import _Check, verify


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
    with sqlite3.connect(folder / "incidents" / "index.sqlite") as connection:
        for statement in statements:
            connection.execute(statement)


def change_chain(change):
    """A change of the chain's lines."""

    def apply(folder):
        path = folder / "incidents" / "chain.jsonl"
        lines = path.read_text().splitlines(keepends=True)
        path.write_text("".join(change(lines)))

    return apply


def change_file(name, old, new):
    """A change of a file's text."""

    def apply(folder):
        path = folder / "incidents" / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    return apply


def copy_folder(old, new, *, with_id):
    """A record that somebody put there."""

    def apply(folder):
        made = folder / "incidents" / new
        shutil.copytree(folder / "incidents" / old, made)
        if with_id:
            change_file(f"{new}/record.json", f'"id":"{old}"', f'"id":"{new}"')(folder)

    return apply


def change_index(*statements):
    return lambda folder: tamper(folder, *statements)


def test_what_was_kept_fits(house):
    done = check(house)
    assert done.fits, done.problems
    assert (done.records, done.removed, done.open, done.files) == (5, 0, 1, 5)


TAMPERING = {
    "a record": (change_file("m2/record.json", "sensor 2", "sensor 9"), "record of m2 (link 4)"),
    "a record without sense": (lambda f: (f / "incidents/m2/record.json").write_bytes(b"\xff{"), "m2/record.json"),
    "a record that is gone": (
        lambda f: (f / "incidents/m2/record.json").unlink(),
        "record of m2 (link 4) does not fit: its content is gone",
    ),
    "a folder that is gone": (
        lambda f: shutil.rmtree(f / "incidents/m2"),
        "record of m2 (link 4) does not fit: its content is gone",
    ),
    "a link": (
        change_chain(lambda lines: [line.replace('"wall":202.0', '"wall":0.0') for line in lines]),
        "record of m2 (link 4) does not fit: its hash",
    ),
    "a link that is gone": (
        change_chain(lambda lines: lines[:3] + lines[4:]),
        "record of m3 (link 5) does not fit: 1 link is missing before it",
    ),
    "a line without sense": (
        change_chain(lambda lines: [*lines[:3], "{x\n", *lines[4:]]),
        "line 4 of chain.jsonl makes no sense",
    ),
    "the end of the chain": (change_chain(lambda lines: lines[:-1]), "chain ends at link 6, but 7 were written"),
    "the order of links": (
        change_chain(
            lambda lines: [
                *lines[:3],
                lines[4].replace('"n":5', '"n":4'),
                lines[3].replace('"n":4', '"n":5'),
                *lines[5:],
            ]
        ),
        "record of m3 (link 4) does not fit: it does not follow",
    ),
    "the list": (
        change_index("UPDATE incidents SET verdict='clear' WHERE id='m2'"),
        "m2 (link 4) does not fit: the list of incidents",
    ),
    "a row that is gone": (
        change_index("DELETE FROM incidents WHERE id='m2'"),
        "m2 (link 4) does not fit: it is missing in the list",
    ),
    "a row that was made up": (
        change_index("UPDATE incidents SET id='made up', link=1 WHERE id='m2'"),
        "m2 (link 4) does not fit: it is missing in the list",
    ),
    "a further row": (
        change_index("UPDATE incidents SET closed=1.0 WHERE id='open'"),
        "the list has an incident open that the chain does not have",
    ),
    "an amendment": (change_file("m1/amendment-7.json", "neighbour", "burglar"), "amendment of m1 (link 7)"),
    "an amendment that is gone": (
        lambda f: (f / "incidents/m1/amendment-7.json").unlink(),
        "amendment of m1 (link 7) does not fit: its content is gone",
    ),
    "a copied folder": (
        copy_folder("m2", "m9", with_id=False),
        "the record of m9 does not fit: holds the record of 'm2'",
    ),
    "an added record": (copy_folder("m2", "m9", with_id=True), "there is a record of m9 that the chain does not have"),
}


@pytest.mark.parametrize("what", TAMPERING)
def test_the_first_record_that_does_not_fit_is_named(house, what):
    change, said = TAMPERING[what]
    change(house)
    done = check(house)
    assert said in done.problems[0]


@pytest.mark.parametrize("what", [what for what in TAMPERING if "row" not in what and "list" not in what])
def test_without_the_index_all_but_the_end_of_the_chain_is_named(house, what):
    for path in (house / "incidents").glob("index.sqlite*"):
        path.unlink()
    change, said = TAMPERING[what]
    change(house)
    if what in ("the end of the chain", "an added record"):  # that only the index knew
        assert check(house).open == 1 + (what == "an added record")
    else:
        assert said in check(house).problems[0]
    assert not list((house / "incidents").glob("index.sqlite*"))


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
    shutil.rmtree(house / "incidents")
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
    change_chain(lambda lines: lines[:-1])(house)
    assert "record of m1 (link 3) does not fit: its content is gone" in check(house).problems[0]


def test_a_chain_that_was_cut_is_named_until_the_index_forgets_it(house, make_incident):
    """A start makes the index anew, and keeps in mind how many links there were."""
    change_chain(lambda lines: lines[:-1])(house)
    with IncidentStore(house) as store:
        (said,) = store.found.said
        assert "knows 7 links, but the chain ends at link 6; it was made anew of the files: 6 records" in said
    assert "chain ends at link 6, but 7 were written" in check(house).problems[0]


def test_what_is_removed_or_closed_while_the_check_runs_is_no_problem(house, make_incident, monkeypatch):
    """The check reads the chain first; then the patrol goes on."""
    with IncidentStore(house) as store:
        survey = _Check._survey

        def survey_and_go_on(check):
            survey(check)
            store.remove("m1", wall=400.0, why="age")
            store.close("open", wall=400.0)
            store.begin(make_incident(id="new"))
            store.close("new", wall=401.0)

        monkeypatch.setattr(_Check, "_survey", survey_and_go_on)
        done = check(house)
        assert done.fits, done.problems
        assert done.records == 4
        monkeypatch.undo()
        assert check(house).records == 6
