"""The decision table of docs/belief.md, a test for each of its rows."""

from __future__ import annotations

from dataclasses import replace

from belief_pictures import EAST, SOUTH, WEST, Seen, box_of

from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.patrol.belief.calibration import CAUTIOUS
from rosbot_patrol.patrol.belief.likelihoods import Veto
from rosbot_patrol.patrol.records.mission import Verdict


def verdict(seen: Seen, *, floor_seen: bool = True) -> Verdict:
    return seen.belief.verdict(floor_seen=floor_seen).verdict


def test_in_full_view() -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST), pictures=8)
    assert verdict(seen) is Verdict.CONFIRMED


def test_half_hidden_behind_a_sofa() -> None:
    """Seen now and then with a low score, over what ends the lidar's beam: open, until another side shows more."""
    seen = Seen()
    half = box_of(WEST, score=0.3, tall=1.0, height=0.45)
    for _ in range(4):
        seen.see(WEST, half, length=2.0)
        seen.see(WEST, length=2.0, pictures=3)
    assert verdict(seen) is Verdict.UNVERIFIED
    seen.see(SOUTH, box_of(SOUTH, score=0.9), pictures=5)
    assert verdict(seen) is Verdict.CONFIRMED


def test_a_dog_near_by() -> None:
    """Its legs alone are open; once it is seen whole, and no box or a low one is there, the room is clear."""
    seen, near = Seen(), Pose2D(-0.8, 0.0, 0.0)
    seen.see(near, box_of(near, tall=0.5, is_cut_above=True), pictures=6)
    assert verdict(seen) is Verdict.UNVERIFIED
    assert "too near to be told from a pet" in seen.belief.verdict(floor_seen=True).why
    for eye in (WEST, SOUTH):
        seen.see(eye, box_of(eye, tall=0.5, wide=0.8), pictures=8)
    assert verdict(seen) is Verdict.CLEAR
    assert seen.only.veto is Veto.PET


def test_a_poster() -> None:
    seen = Seen()
    seen.see(WEST, box_of(WEST, score=0.95, is_flat=True), pictures=12)
    assert verdict(seen) is Verdict.CLEAR
    assert seen.only.veto is Veto.FLAT
    assert seen.belief.why(seen.only).endswith("is no intruder: it is flat, a picture or a screen")


def test_a_person_in_the_dark() -> None:
    """A few low scores among misses: open, not clear; a surer picture from another side confirms."""
    seen = Seen()
    for _ in range(3):
        seen.see(WEST, box_of(WEST, score=0.3), is_dark=True)
        seen.see(WEST, pictures=2, is_dark=True)
    assert verdict(seen) is Verdict.UNVERIFIED
    seen.see(EAST, box_of(EAST, score=0.7), pictures=6, is_dark=True)
    assert verdict(seen) is Verdict.CONFIRMED


def test_a_camera_that_hangs() -> None:
    """The same picture again and again adds nothing, neither for somebody nor for the floor."""
    seen = Seen()
    seen.see(WEST, box_of(WEST, score=0.7))
    before = seen.posterior
    seen.see(SOUTH, box_of(SOUTH, score=0.7), pictures=30, is_same=True)
    assert seen.posterior == before
    assert verdict(seen, floor_seen=False) is Verdict.UNVERIFIED


def test_a_person_behind_the_robot() -> None:
    """Nothing is known of what was not in view: not clear before the floor was seen, confirmed when it turns."""
    seen = Seen()
    seen.see(Pose2D(-3.0, 0.0, 3.14), pictures=20)
    assert verdict(seen, floor_seen=False) is Verdict.UNVERIFIED
    seen.see(WEST, box_of(WEST), pictures=8)
    assert verdict(seen, floor_seen=False) is Verdict.CONFIRMED


def test_a_reflection() -> None:
    """What a mirror shows stands behind its wall, outside of the floor; from elsewhere it is not at that place."""
    seen = Seen()
    shown = replace(box_of(WEST, 3.0, 0.0, score=0.6), measured=None)
    seen.see(WEST, shown, pictures=3, length=3.0)
    assert verdict(seen) is Verdict.UNVERIFIED
    for eye in (SOUTH, EAST):
        seen.see(eye, pictures=12)
    assert verdict(seen) is not Verdict.CONFIRMED


def test_a_network_without_a_calibration_needs_two_sides() -> None:
    seen = Seen(calibration=CAUTIOUS)
    seen.see(WEST, box_of(WEST), pictures=30)
    assert verdict(seen) is Verdict.UNVERIFIED
    seen.see(SOUTH, box_of(SOUTH), pictures=5)
    assert verdict(seen) is Verdict.CONFIRMED
