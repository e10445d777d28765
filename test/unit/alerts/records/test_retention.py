import pytest

from rosbot_patrol.alerts.records import retention
from rosbot_patrol.alerts.records.files import NewFile
from rosbot_patrol.alerts.records.retention import DAY, MB, PruneReason, RetentionParams, make_room, prune
from rosbot_patrol.alerts.records.store import IncidentStore
from rosbot_patrol.alerts.records.verify import verify

NOW = 1000 * DAY


@pytest.fixture
def house(quick_disk, make_incident, monkeypatch):
    monkeypatch.setattr(retention, "ALWAYS_KEPT", 0)
    monkeypatch.setattr(retention, "free_bytes", lambda _: 10_000 * MB)
    with IncidentStore(quick_disk) as store:
        for age in (400, 40, 20):
            for verdict in ("confirmed", "clear", "unreachable"):
                name = f"{verdict}{age}"
                store.begin(make_incident(id=name, wall=NOW - age * DAY, verdict=verdict))
                store.add_files(name, [NewFile(name="a.jpg", role="look", data=bytes(100_000))])
                store.close(name, wall=NOW - age * DAY)
        store.begin(make_incident(id="open", wall=0.0, verdict=""))
        yield store


def prune_all(store, **given):
    gone = []
    while True:
        done = prune(store, RetentionParams(**given), wall=NOW)
        gone += done.ids
        if not done.ids:
            return gone


def test_clear_ones_go_sooner(house):
    assert prune_all(house) == ["clear400", "clear40", "unreachable400", "confirmed400"]
    assert verify(house).fits
    assert verify(house).removed == 4
    assert not house.folder.path("clear40").exists()
    assert house.open_ids() == ("open",)


def test_a_clock_that_jumps_ahead_leaves_the_newest(house, monkeypatch):
    monkeypatch.setattr(retention, "ALWAYS_KEPT", 2)
    assert prune(house, RetentionParams(), wall=1e6 * DAY).ids == ("clear400", "unreachable400", "confirmed400")
    assert prune(house, RetentionParams(), wall=1e6 * DAY).ids == ()


def test_by_size_the_oldest_clear_ones_go_first_and_confirmed_ones_last(house, monkeypatch):
    for store_mb, gone in ((0.85, 1), (0.65, 2), (0.55, 1), (0.25, 3)):
        monkeypatch.setattr(retention, "used_bytes", lambda s: s.connection.execute(_SUM).fetchone()[0])
        done = prune(house, RetentionParams(keep_days=1e6, keep_clear_days=1e6, keep_mb=10.0), wall=NOW)
        assert done.ids == ()
        params = RetentionParams(keep_days=1e6, keep_clear_days=1e6, keep_mb=store_mb)
        done = prune(house, params, wall=NOW)
        assert len(done.ids) == gone
        assert done.reason is PruneReason.BUDGET
        assert not done.reason.is_of_disk
    rest = [row["id"] for row in house.connection.execute("SELECT id FROM incidents WHERE closed NOT NULL")]
    assert sorted(rest) == ["confirmed20", "confirmed40"]


_SUM = "SELECT sum(bytes) FROM incidents"


def test_a_disk_that_fills_takes_clear_ones_then_others_and_never_confirmed_ones(house, monkeypatch):
    monkeypatch.setattr(retention, "free_bytes", lambda _: 199.9 * MB)
    params = RetentionParams(keep_days=1e6, keep_clear_days=1e6)
    done = prune(house, params, wall=NOW)
    assert done.ids == ("clear400",)
    assert "less than 200 MB were free" in done.sentence
    assert done.reason is PruneReason.DISK_LOW
    assert done.reason.is_of_disk
    monkeypatch.setattr(retention, "free_bytes", lambda _: 0)
    order = ["clear40", "clear20", "unreachable400", "unreachable40", "unreachable20"]
    assert prune_all(house, keep_days=1e6, keep_clear_days=1e6) == order


def test_only_so_many_go_at_once(house, monkeypatch):
    monkeypatch.setattr(retention, "AT_ONCE", 2)
    done = prune(house, RetentionParams(), wall=NOW)
    assert (done.ids, done.is_done) == (("clear400", "clear40"), False)


def test_room_is_made_from_what_is_held_for_it(house):
    retention.keep_reserve(house.state_dir)
    assert (house.state_dir / "incidents.reserve").stat().st_size == 2 * MB
    done = make_room(house, wall=NOW, wanted=0.15 * MB)
    assert done.ids == ("clear400", "clear40")
    assert "the disk is full" in done.sentence
    assert (house.state_dir / "incidents.reserve").exists()
