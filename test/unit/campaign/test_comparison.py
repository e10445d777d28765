"""Two campaigns compared, and what chance may make of a difference."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from rosbot_patrol.campaign.comparison import changes, compare_shares, comparison_page, comparison_text, pairs
from rosbot_patrol.campaign.intervals import difference, sign_test
from rosbot_patrol.campaign.record import CampaignFolder, Result, Settings, results_in
from rosbot_patrol.errors import ParamError


def result(number: int, *, found: bool = True, **changed: object) -> Result:
    plain = Result(
        number=number, seed=1, kind="standing", house="flat", room=1, title=f"somebody {number}", expected="confirmed",
        verdict="confirmed" if found else "clear", was_there=True, mails=int(found), home=True,
        place_error=0.1 if found else None,
    )  # fmt: skip
    return replace(plain, **changed)  # type: ignore[arg-type]


def test_the_interval_of_a_difference_is_newcombe_s() -> None:
    # Newcombe (1998), table II, (a): 56/70 and 48/80, method 10: 0.0524 to 0.3339
    value, low, high = difference((48, 80), (56, 70))
    assert value == pytest.approx(0.2)
    assert (low, high) == pytest.approx((0.0524, 0.3339), abs=5e-5)


def test_the_sign_test_is_exact() -> None:
    assert sign_test(0, 0) == 1.0
    assert sign_test(5, 5) == 1.0
    assert sign_test(0, 6) == pytest.approx(2.0 / 64.0)
    assert sign_test(6, 0) == sign_test(0, 6)


def test_a_better_campaign_is_told_from_an_equal_one() -> None:
    before = [result(n, found=n % 2 == 0) for n in range(40)]
    after = [result(n) for n in range(40)]
    detected = compare_shares(before, after)[0]
    assert detected.verdict == "better"
    assert compare_shares(after, before)[0].verdict == "worse"
    assert compare_shares(after, after)[0].verdict == "no difference can be told"
    both = pairs(before, after)
    better, worse = changes(both)
    assert (len(both), len(better), len(worse)) == (40, 20, 0)
    text = comparison_text(before, after)
    assert "40 patrols in both: 20 right only in the second, 0 right only in the first" in text
    assert "+ 1: missed (somebody 1)" in text
    assert "20 of 40" in text


def test_fewer_false_alarms_are_better() -> None:
    empty = [result(n, found=False, was_there=False, expected="clear") for n in range(40)]
    alarms = [replace(r, verdict="confirmed", mails=1) for r in empty]
    row = next(row for row in compare_shares(alarms, empty) if "false alarms" in row.first.name)
    assert row.verdict == "better"


def test_other_patrols_are_not_compared_one_by_one() -> None:
    assert "They have no patrol in common" in comparison_text([result(1)], [result(1, room=2)])


def test_the_page_is_whole_and_escapes() -> None:
    text = comparison_page([result(1, title="<b>")], [result(1, title="<b>", found=False)], subtitle="a & b")
    assert "a &amp; b" in text
    assert "&lt;b&gt;" in text
    assert "$" not in text


def test_a_folder_without_results_is_told(tmp_path: Path) -> None:
    with pytest.raises(ParamError, match="holds no campaign"):
        results_in(tmp_path)
    CampaignFolder(tmp_path, Settings(seed=1, houses=("flat",)))
    with pytest.raises(ParamError, match="holds a campaign without any result"):
        results_in(tmp_path)
