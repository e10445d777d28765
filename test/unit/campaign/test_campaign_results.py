"""Records, tables and intervals."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from rosbot_patrol.campaign.intervals import wilson
from rosbot_patrol.campaign.progress import clock, progress_line
from rosbot_patrol.campaign.record import CampaignFolder, Result, Settings, result_from_plain
from rosbot_patrol.campaign.table import HEADINGS, figures, markdown_table, measures, row, shares, summary, text_table
from rosbot_patrol.errors import ParamError


def result(number: int = 0, **changes: Any) -> Result:
    known: dict[str, Any] = {
        "kind": "standing", "house": "flat", "room": 1, "title": "somebody", "expected": "confirmed",
        "verdict": "confirmed", "was_there": True, "in_view": 4.0, "mails": 1, "home": True,
        "times": {"goal": 0.1, "notice": 20.0}, "localisation": (0.02, 0.05),
    }  # fmt: skip
    return Result(number=number, seed=1, **{**known, **changes})


EMPTY = {"kind": "empty", "expected": "clear", "verdict": "clear", "was_there": False, "mails": 0, "times": {}}


@pytest.mark.parametrize(
    ("hits", "trials", "low", "high"),
    [(10, 10, 0.7225, 1.0), (0, 10, 0.0, 0.2775), (81, 263, 0.2553, 0.3662), (0, 0, 0.0, 1.0)],
)
def test_the_score_interval_is_wilsons(hits: int, trials: int, low: float, high: float) -> None:
    # the last but one: Newcombe 1998, table I, method 3
    assert wilson(hits, trials) == pytest.approx((low, high), abs=5e-5)


def test_an_interval_of_more_than_all_is_refused() -> None:
    with pytest.raises(ValueError, match="3 of 2"):
        wilson(3, 2)


@pytest.mark.parametrize(
    ("changes", "failures"),
    [
        ({}, ()),
        (EMPTY, ()),
        ({"verdict": "clear", "mails": 0}, ("missed",)),
        ({"verdict": "unverified", "mails": 0}, ("missed",)),
        ({**EMPTY, "verdict": "confirmed", "mails": 1}, ("false alarm",)),
        ({**EMPTY, "verdict": "unreachable"}, ("unreachable in a room without anybody",)),
        ({"mails": 2}, ("2 mails",)),
        ({"mails": 0, "shown": 1}, ("0 mails",)),
        ({"people": 2}, ()),
        ({"people": 2, "shown": 2}, ("1 mail for 2 people in view",)),
        ({"people": 2, "shown": 2, "mails": 2}, ()),
        ({"contacts": ["sofa", "sofa"]}, ("touched sofa",)),
        ({"home": False}, ("not home",)),
        ({"place_error": 0.9}, ()),
        ({"place_error": 2.79}, ("told 2.8 m from anybody",)),
        ({"problem": "did not end within 630 s", "verdict": "", "was_there": False, "mails": 0, "home": None},
         ("did not end within 630 s",)),
    ],
)  # fmt: skip
def test_what_went_wrong_is_named(changes: dict[str, Any], failures: tuple[str, ...]) -> None:
    assert result(**changes).failures == failures


@pytest.mark.parametrize(
    ("changes", "failures"),
    [
        ({"verdict": "unverified", "mails": 0}, ()),
        ({"verdict": "clear", "mails": 0}, ("missed",)),
        ({**EMPTY, "verdict": "unverified"}, ()),
        ({**EMPTY, "verdict": "unreachable"}, ("unreachable in a room without anybody",)),
        ({**EMPTY, "verdict": "confirmed"}, ("false alarm", "0 mails")),
        ({"people": 2, "shown": 2}, ()),
    ],
)
def test_what_broke_excuses_only_what_it_has_to(changes: dict[str, Any], failures: tuple[str, ...]) -> None:
    broken = result(mishap="the camera is gone for 9 s", allowed=("unverified",), **changes)
    assert broken.failures == failures
    assert result_from_plain(json.loads(broken.to_json())) == broken


def test_patrols_in_which_something_broke_are_counted_by_themselves() -> None:
    results = [result(0), result(1, mishap="m", allowed=("unverified",), verdict="unverified", mails=0)]
    counted = {share.name.partition(",")[0]: (share.hits, share.trials) for share in shares(results)}
    assert counted["detected"] == counted["as it should be though something broke"] == (1, 1)
    assert figures(results)["survived_rate"] == 1.0
    assert "survived_rate" not in figures(results[:1])


def test_a_folder_from_before_there_were_faults_goes_on(tmp_path: Path) -> None:
    (tmp_path / "campaign.json").write_text('{"seed": 1, "houses": ["flat"], "kind": "patrols"}')
    CampaignFolder(tmp_path, Settings(seed=1, houses=("flat",)))
    with pytest.raises(ParamError, match="faults 0, not 2"):
        CampaignFolder(tmp_path, Settings(seed=1, houses=("flat",), faults=2))


def test_a_folder_in_which_every_other_patrol_had_a_fault_goes_on(tmp_path: Path) -> None:
    (tmp_path / "campaign.json").write_text('{"seed": 1, "houses": ["flat"], "kind": "patrols", "faults": true}')
    CampaignFolder(tmp_path, Settings(seed=1, houses=("flat",), faults=2))


def test_a_result_outlives_the_file_and_a_newer_version() -> None:
    kept = result()
    tree = json.loads(kept.to_json())
    assert result_from_plain({**tree, "colour": "blue"}) == kept
    del tree["kind"]
    with pytest.raises(TypeError, match="kind"):
        result_from_plain(tree)


def test_a_folder_goes_on_with_its_own_campaign_only(tmp_path: Path) -> None:
    settings = Settings(seed=1, houses=("house", "flat"))
    folder = CampaignFolder(tmp_path, settings)
    folder.of(3).mkdir()
    (folder.of(3) / "result.json").write_text(result(3).to_json())
    again = CampaignFolder(tmp_path, settings)
    assert again.results() == [result(3)]
    assert again.result(4) is None
    with pytest.raises(ParamError, match=r"holds a campaign of another kind .seed 1, not 2.: name another folder"):
        CampaignFolder(tmp_path, dataclasses.replace(settings, seed=2))
    (folder.of(3) / "result.json").write_text("{half")
    with pytest.raises(ParamError, match=r"result.json: cannot be read .*: remove it"):
        again.results()


def test_shares_count_what_they_say() -> None:
    results = [
        result(0, place_error=0.1),
        result(1, verdict="clear", mails=0),
        result(2, **EMPTY),
        result(3, **{**EMPTY, "verdict": "confirmed", "mails": 1}, place_error=2.0),
        result(4, problem="did not end", verdict="", was_there=False, home=None, mails=0),
    ]
    counted = [(share.hits, share.trials) for share in shares(results)]
    assert counted == [(1, 2), (1, 2), (1, 2), (4, 5), (4, 4), (4, 4), (2, 2)]
    assert "detected, of those who were there: 1 of 2 (9.5% to 90.5%)" in summary(results)
    assert figures(results)["detection_rate"] == 0.5
    assert figures(results)["false_alarms"] == 1.0


def test_what_is_not_known_is_a_dash_and_no_number() -> None:
    cells = dict(zip(HEADINGS, row(result(place_error=None)), strict=True))
    assert cells["place off [m]"] == cells["seen [%]"] == cells["home [s]"] == "-"
    assert cells["loc. max [m]"] == "0.05"
    assert not [name for name, *_ in measures([result()]) if name.startswith("place")]


def test_tables_line_up() -> None:
    rows = [row(result()), row(result(1, **EMPTY))]
    lines = text_table(HEADINGS, rows).splitlines()
    assert len({line.index(word) for line, word in zip(lines, ("verdict", "confirmed", "clear"), strict=True)}) == 1
    assert markdown_table(("a", "b"), [("1|2", "3")]) == "| a | b |\n|---|---|\n| 1/2 | 3 |"


def test_the_bar_tells_what_is_left() -> None:
    assert progress_line(30, 60, 10, 600.0, failed=1) == (
        "[############............] 30 of 60, 1 not as they should be, 10 min 00 s gone, 30 min 00 s left"
    )
    assert progress_line(0, 60, 0, 0.0, failed=0) == "[........................] 0 of 60, 0 s gone"
    assert clock(3725.0) == "1 h 02 min"
