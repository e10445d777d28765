import os

import pytest

from rosbot_patrol.alerts.outbox.receipts import Receipt, Receipts


def receipt(*ids, channel="mail", wall=5.0):
    return Receipt(channel=channel, transport="smtp", ids=ids, wall=wall, where="Küche")


def test_what_one_writes_another_reads_along(tmp_path):
    path = tmp_path / "taken.jsonl"
    writer, reader = Receipts(path), Receipts(path)
    assert reader.read_new() == []
    writer.add(receipt("a"))
    writer.add(receipt("b", "c", channel="phone", wall=7.0))
    assert [r.ids for r in reader.read_new()] == [("a",), ("b", "c")]
    assert reader.read_new() == []
    assert reader.taken == writer.taken == {"a": {"mail"}, "b": {"phone"}, "c": {"phone"}}
    assert reader.last == {"mail": 5.0, "phone": 7.0}


@pytest.mark.parametrize(("cut", "kept"), [(1, {"a", "b", "c"}), (2, {"a", "c"}), (10, {"a", "c"}), (60, {"a", "c"})])
def test_a_line_that_a_crash_cut_counts_as_not_written(tmp_path, cut, kept):
    path = tmp_path / "taken.jsonl"
    Receipts(path).add(receipt("a"))
    Receipts(path).add(receipt("b"))
    os.truncate(path, path.stat().st_size - cut)
    after = Receipts(path)
    after.read_new()
    assert set(after.taken) == {"a"}
    after.add(receipt("c"))
    again = Receipts(path)
    again.read_new()
    assert set(again.taken) == kept  # with its end alone missing a line is whole


def test_a_full_disk_leaves_no_part_of_a_line(tmp_path, monkeypatch):
    path = tmp_path / "taken.jsonl"
    Receipts(path).add(receipt("a"))
    real = os.write
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", lambda handle, data: real(handle, data[:10]))
        with pytest.raises(OSError, match="No space left"):
            Receipts(path).add(receipt("b"))
    Receipts(path).add(receipt("c"))
    read = Receipts(path)
    read.read_new()
    assert set(read.taken) == {"a", "c"}


def test_the_file_stays_small_and_keeps_what_still_waits(tmp_path):
    path = tmp_path / "taken.jsonl"
    writer, reader = Receipts(path), Receipts(path)
    for i in range(50):
        writer.add(receipt(f"n{i}"))
    reader.read_new()
    writer.compact(["n3"], lines=10)
    assert len(path.read_bytes().splitlines()) == 11
    assert reader.read_new() == []  # nothing is news
    writer.add(receipt("late"))
    assert [r.ids for r in reader.read_new()] == [("late",)]
    fresh = Receipts(path)
    fresh.read_new()
    assert "n3" in fresh.taken
    assert "n4" not in fresh.taken
