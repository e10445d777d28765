from __future__ import annotations

import math

import pytest

from rosbot_patrol.patrol.intruder.camera_tracking import CameraTracking, CameraTrackingParams


def play(
    track: CameraTracking, bearing_of, seconds: float, yaw: float = 0.0, seen=lambda now: True
) -> tuple[float, float]:
    """Turn a base as told at 20 Hz; the heading at the end and the time at which it let go (inf: not)."""
    now, let_go = 0.0, math.inf
    while now < seconds:
        if seen(now) and round(now * 20) % 2 == 0:
            track.see(now, math.remainder(bearing_of(now) - yaw, math.tau), yaw)
        speed = track.step(now, yaw)
        if speed is None and let_go == math.inf:
            let_go = now
        yaw += (speed or 0.0) * 0.05
        now += 0.05
    return yaw, let_go


@pytest.mark.parametrize("bearing", [0.4, -0.5, 3.0])
def test_the_camera_turns_to_the_person(bearing: float) -> None:
    yaw, let_go = play(CameraTracking(), lambda _: bearing, 6.0)
    assert math.remainder(yaw - bearing, math.tau) == pytest.approx(0.0, abs=0.1)
    assert let_go == math.inf


def test_one_who_walks_past_is_followed() -> None:
    yaw, _ = play(CameraTracking(), lambda now: 0.3 * now, 5.0)
    assert yaw == pytest.approx(1.5, abs=0.35)


def test_the_speed_is_bounded() -> None:
    track = CameraTracking(CameraTrackingParams(track_speed=0.5))
    track.see(0.0, 2.0, 0.0)
    assert track.step(0.05, 0.0) == 0.5
    track.see(0.1, -2.0, 0.0)
    assert track.step(0.15, 0.0) == -0.5


def test_one_in_the_middle_needs_no_turning() -> None:
    track = CameraTracking()
    track.see(0.0, 0.02, 1.0)
    assert track.step(0.05, 1.0) == 0.0


def test_whoever_is_lost_is_waited_for_a_moment() -> None:
    _, let_go = play(CameraTracking(), lambda _: 0.0, 6.0, seen=lambda now: now < 2.0)
    assert let_go == pytest.approx(3.5, abs=0.2)


def test_whoever_stays_is_let_go_and_not_taken_again_for_a_while() -> None:
    track = CameraTracking(CameraTrackingParams(track_time=4.0, track_pause=10.0))
    _, let_go = play(track, lambda _: 0.0, 12.0)
    assert let_go == pytest.approx(4.0, abs=0.2)
    assert not track.is_on
    track.see(15.0, 0.0, 0.0)
    assert track.is_on


def test_one_who_walks_to_and_fro_is_watched_no_longer_in_all() -> None:
    track = CameraTracking(CameraTrackingParams(track_time=6.0, track_lost=1.0, track_pause=10.0))
    held = []
    for k in range(1200):  # in view for 3 of 5 s, a minute long
        now = 0.05 * k
        if now % 5.0 < 3.0:
            track.see(now, 0.0, 0.0)
        track.step(now, 0.0)
        held.append(track.is_on)
    free = "".join("-" if on else "." for on in held).split("-")
    assert sum(len(part) >= 190 for part in free) >= 3
    assert sum(held) < 0.45 * len(held)


def test_whoever_comes_much_later_is_watched_from_the_beginning() -> None:
    track = CameraTracking(CameraTrackingParams(track_time=4.0, track_pause=10.0))
    play(track, lambda _: 0.0, 6.0, seen=lambda now: now < 2.0)
    track.see(20.0, 0.0, 0.0)
    track.see(23.0, 0.0, 0.0)
    assert track.step(23.9, 0.0) == 0.0


def test_it_can_be_switched_off() -> None:
    track = CameraTracking(CameraTrackingParams(track_time=0.0))
    track.see(0.0, 1.0, 0.0)
    assert track.step(0.0, 0.0) is None


def test_without_a_heading_it_stands() -> None:
    track = CameraTracking()
    track.see(0.0, 1.0, None)
    assert not track.is_on
    track.see(0.0, 1.0, 0.0)
    assert track.step(0.1, None) == 0.0
