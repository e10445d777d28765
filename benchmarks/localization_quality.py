"""Quality of amcl's localisation on recorded drives: in patrols, from unknown starts, and after a kidnapping."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import yaml
from localization_drives import HOUSES, Record, carried, patrol, wandering
from localization_drives import map_of as known_map

from rosbot_patrol.amcl.localizer import Localizer
from rosbot_patrol.amcl.parameters import AmclParams
from rosbot_patrol.amcl.trust import State
from rosbot_patrol.geometry import Pose2D, compose, invert
from rosbot_patrol.params import load

ROOT = Path(__file__).resolve().parents[1]
SETTLE_S = 5.0  # time after the start that does not count for the accuracy
RIGHT_M, RIGHT_RAD = 0.3, math.radians(15.0)
START_S, CARRIED_S = 60.0, 60.0  # time limits for finding the pose
BEFORE_S = 20.0  # time that a robot drives before it is carried away
PLACED = np.diag([0.01, 0.01, 0.005])


@cache
def parameters(profile: str) -> AmclParams:
    """Parameters of a profile, as the launch files set them in the simulation."""
    if profile == "tutorial":
        return AmclParams(odom_model_type="diff-corrected", update_min_d=0.5, update_min_a=1.0)
    tree = yaml.safe_load((ROOT / "config" / "tuned" / "amcl.yaml").read_text(encoding="utf-8"))
    return load(AmclParams, tree, name="amcl.yaml: ")


@dataclass(frozen=True)
class Trace:
    """amcl's results on one record.

    Attributes:
        seconds: time of each scan since the start, shape (N,).
        off: distance from the truth [m], shape (N,).
        turned: rotation from the truth [rad], shape (N,).
        believed: whether amcl reported itself localised, shape (N,).
        searches: number of searches that found a place.
    """

    seconds: np.ndarray
    off: np.ndarray
    turned: np.ndarray
    believed: np.ndarray
    searches: int

    def after(self, begin: float) -> Trace:
        """The part after a time [s]."""
        kept = self.seconds > begin
        return Trace(self.seconds[kept], self.off[kept], self.turned[kept], self.believed[kept], self.searches)

    @property
    def is_right(self) -> np.ndarray:
        """Whether each estimate was right, shape (N,)."""
        return (self.off < RIGHT_M) & (self.turned < RIGHT_RAD)

    def found_after(self, begin: float = 0.0) -> float:
        """Time from `begin` until the estimate was right and stayed so [s], inf if it never was."""
        wrong = np.flatnonzero(~self.is_right)
        if not len(wrong):
            return 0.0
        if wrong[-1] + 1 >= len(self.seconds):
            return math.inf
        return max(float(self.seconds[wrong[-1] + 1]) - begin, 0.0)


def follow(record: Record, profile: str, seed: int, *, start: Pose2D | None) -> Trace:
    """Run amcl over a record; without a start it localises globally."""
    localizer = Localizer(parameters(profile), np.random.default_rng(seed))
    localizer.set_map(known_map(record.house))
    if start is None:
        localizer.localize_globally()
    else:
        localizer.set_pose(start, PLACED)
    rows, searches, first = [], 0, record.moments[0].scan.stamp
    for moment in record.moments:
        searches += localizer.update(moment.scan, moment.odometry, record.mount).is_found
        assert localizer.map_from_odom is not None
        off = compose(invert(moment.truth), compose(localizer.map_from_odom, moment.odometry))
        believed = localizer.trust.state is State.LOCALISED
        rows.append((moment.scan.stamp - first, math.hypot(off.x, off.y), abs(off.yaw), believed))
    seconds, away, turned, trusted = np.array(rows, dtype=np.float64).T
    return Trace(seconds, away, turned, trusted > 0.5, searches)


def accuracy(seeds: int, *, rooms: int | None, profiles: tuple[str, ...] = ("tuned", "tutorial")) -> dict[str, float]:
    """Measure patrols of each house; prints each."""
    traces: dict[str, list[Trace]] = {profile: [] for profile in profiles}
    for house in HOUSES:
        for seed in range(seeds):
            record = patrol(house, seed, rooms)
            for profile in profiles:
                trace = follow(record, profile, seed, start=record.moments[0].truth).after(SETTLE_S)
                traces[profile].append(trace)
                print(
                    f"{house} {seed} {profile}: {trace.seconds[-1]:.0f} s, rms {_rms([trace.off]):.3f} m"
                    f" {math.degrees(_rms([trace.turned])):.2f} deg, most {trace.off.max():.3f} m,"
                    f" believed {100.0 * trace.believed.mean():.1f} %, searches {trace.searches}",
                    flush=True,
                )
    figures = {}
    for profile in profiles:
        suffix = "" if profile == "tuned" else f"_{profile}"
        figures[f"rms_position{suffix}_m"] = round(_rms([t.off for t in traces[profile]]), 4)
        figures[f"rms_heading{suffix}_deg"] = round(math.degrees(_rms([t.turned for t in traces[profile]])), 3)
    return figures


def _rms(parts: list[np.ndarray]) -> float:
    return float(np.sqrt(np.square(np.concatenate(parts)).mean()))


def _houses(count: int) -> Iterator[tuple[str, int]]:
    for number in range(count):
        yield list(HOUSES)[number % len(HOUSES)], number


def global_starts(count: int, profile: str = "tuned") -> dict[str, float]:
    """Measure global localisation from random starts; prints each."""
    times, wrongly = [], 0
    for house, seed in _houses(count):
        trace = follow(wandering(house, 1000 + seed, START_S), profile, seed, start=None)
        times.append(trace.found_after())
        wrongly += _tell("start", house, seed, trace, times[-1])
    return _rates("global_localization", times, wrongly)


def kidnappings(count: int, profile: str = "tuned") -> dict[str, float]:
    """Measure kidnappings from one place to another during a drive; prints each."""
    times, wrongly = [], 0
    for house, seed in _houses(count):
        before, after = wandering(house, 2000 + seed, BEFORE_S), wandering(house, 3000 + seed, CARRIED_S)
        trace = follow(carried(before, after), profile, seed, start=before.moments[0].truth)
        times.append(trace.found_after(BEFORE_S))
        wrongly += _tell("carried", house, seed, trace, times[-1])
    found = _rates("kidnap", times, wrongly)
    found["kidnap_recovery_rate"] = found.pop("kidnap_rate")
    return found


def _tell(what: str, house: str, seed: int, trace: Trace, after: float) -> int:
    """Print a line; returns 1 if amcl trusted a wrong estimate at the end."""
    wrong = int(trace.believed[-1] and not trace.is_right[-1])
    end = "never right" if math.isinf(after) else f"right after {after:.1f} s"
    doubtful = 0.1 * float((trace.believed & ~trace.is_right).sum())
    print(
        f"{what} {house} {seed}: {end}, searches {trace.searches}, believed while wrong for {doubtful:.1f} s"
        f"{', WRONG AND SURE AT THE END' if wrong else ''}",
        flush=True,
    )
    return wrong


def _rates(name: str, times: list[float], wrongly: int) -> dict[str, float]:
    return {
        f"{name}_rate": sum(map(math.isfinite, times)) / len(times),
        f"{name}_median_s": round(float(np.median(times)), 1),
        f"{name}_wrong_and_sure": wrongly,
    }
