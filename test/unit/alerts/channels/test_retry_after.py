import pytest

from rosbot_patrol.alerts.channels.retry_after import parse_retry_after

NOW = 784_111_777.0  # Sun, 06 Nov 1994 08:49:37 GMT


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("120", 120.0),
        ("64.57", 64.57),
        (" 7 ", 7.0),
        ("0", 0.0),
        (".5", 0.5),
        ("-5", 0.0),
        ("-0.5", 0.0),
        ("Sun, 06 Nov 1994 08:50:37 GMT", 60.0),
        ("Sunday, 06-Nov-94 08:50:37 GMT", 60.0),
        ("Sun Nov  6 08:50:37 1994", 60.0),
        ("Sun Nov 6 08:50:37 1994", 60.0),
        ("sun, 06 nov 1994 08:50:37 gmt", 60.0),
        ("Sun, 06 Nov 1994 08:50:60 GMT", 82.0),  # a leap second
        ("Sun, 06 Nov 1994 09:50:37 +0100", 60.0),  # no date of HTTP's, but clear
        ("Sun, 06 Nov 1994 08:49:37 GMT", 0.0),
        ("Sat, 05 Nov 1994 08:49:37 GMT", 0.0),
        ("Thursday, 01-Jan-70 00:00:00 GMT", 0.0),
        ("Wed, 06 Nov 2094 08:49:37 GMT", 3_155_760_000.0),
    ],
)
def test_seconds_and_the_three_dates_of_http(text, seconds):
    assert parse_retry_after(text, NOW) == pytest.approx(seconds)


@pytest.mark.parametrize("text", ["", "  ", "\t"])
def test_nothing_is_no_wish(text):
    assert parse_retry_after(text, NOW) is None


@pytest.mark.parametrize(
    "text",
    [
        "soon", "5 seconds", "5, 10", "64,57", "1e3", "0x10", "inf", "nan", "²", "٣", "1.2.3", "-", ".",
        "2026-11-28T10:00:00Z",
        "Sun, 31 Feb 2026 00:00:00 GMT", "Sun, 06 Nov 1994 99:00:00 GMT", "Sun, 06 Nov 99999 08:49:37 GMT",
        "Sun, 06 Nov 1994", "Sun,", "Nov", "6 6 6 6 6", "a" * 100_000,
    ],
)  # fmt: skip
def test_what_is_neither_is_an_error(text):
    with pytest.raises(ValueError, match="neither seconds nor a date") as caught:
        parse_retry_after(text, NOW)
    assert len(str(caught.value)) < 120


def test_the_zone_of_the_machine_does_not_count(monkeypatch):
    import time

    monkeypatch.setenv("TZ", "Asia/Tokyo")
    time.tzset()
    try:
        assert parse_retry_after("Sun Nov  6 08:50:37 1994", NOW) == 60.0
    finally:
        monkeypatch.undo()
        time.tzset()
