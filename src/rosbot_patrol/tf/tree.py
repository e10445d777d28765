"""tf without ROS: parents, poses and times of frames, looked up as in tf2 (0.7).

Frame names may carry tf1's leading slash. Moving transforms are kept for `cache_s`, static ones for ever. Between two
stamps, positions are interpolated linearly and rotations on the shortest arc.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from typing import NamedTuple

from rosbot_patrol.errors import TransformError, TransformNotYet, TransformTooOld
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.geometry import Transform as Transform

UNIT_WITHIN = 1e-3  # tolerance of a quaternion's length; tf2 refuses others, and so do we


class Edge(NamedTuple):
    """parent_from_child at a time [s]: a position [m] and a quaternion."""

    parent: str
    child: str
    stamp: float
    x: float
    y: float
    z: float
    qx: float
    qy: float
    qz: float
    qw: float


IDENTITY = Transform()


class TransformTree:
    """All transforms received.

    Args:
        cache_s: age, against the newest of its frame, at which a moving transform is dropped [s].
    """

    def __init__(self, cache_s: float = 10.0) -> None:
        self._cache_s = cache_s
        self._above: dict[str, _Moving | _Static] = {}

    def add(self, edge: Edge, *, is_static: bool = False) -> str:
        """Add a transform; returns why it is ignored, "" if it is not (tf2 ignores the same)."""
        parent, child = edge.parent.lstrip("/"), edge.child.lstrip("/")
        problem = _problem(edge, parent, child)
        if problem:
            return problem
        place = Transform(*edge[3:])
        known = self._above.get(child)
        if is_static:
            self._above[child] = _Static(parent, place)
            return ""
        if not isinstance(known, _Moving):
            known = self._above[child] = _Moving(self._cache_s)
        return known.add(edge.stamp, parent, place)

    def add_all(self, edges: Iterable[Edge], *, is_static: bool = False) -> None:
        """Add several transforms; invalid ones are ignored as in `add`."""
        for edge in edges:
            self.add(edge, is_static=is_static)

    def clear(self) -> None:
        """Forget moving transforms, because time went back."""
        self._above = {frame: above for frame, above in self._above.items() if isinstance(above, _Static)}

    def transform(self, target: str, source: str, stamp: float | None = None) -> Transform:
        """Look up target_from_source at a time [s], or the newest time that all transforms between them share.

        Raises:
            TransformNotYet: a frame is unknown, not connected, or not yet known at that time.
            TransformTooOld: that time is no longer stored.
        """
        target, source = target.lstrip("/"), source.lstrip("/")
        if target == source:
            return IDENTITY
        when = self._newest_common(target, source) if stamp is None else stamp
        rising, problem = self._climb(source, when, target)
        if target in rising:
            return rising[target]
        falling, other_problem = self._climb(target, when, source)
        for frame, frame_from_source in rising.items():
            if frame in falling:
                return _compose(_invert(falling[frame]), frame_from_source)
        raise self._unknown(target, source, problem or other_problem)

    def newest(self, target: str, source: str) -> tuple[Transform, float]:
        """The newest target_from_source and its time [s], 0 if nothing between them moves; raises as `transform`."""
        stamp = self._newest_common(target.lstrip("/"), source.lstrip("/"))
        return self.transform(target, source, stamp), stamp

    def lookup(self, target: str, source: str, stamp: float | None = None) -> Pose2D:
        """Look up the planar part of `transform`; raises as that does."""
        return self.transform(target, source, stamp).pose

    def lookup_stamped(self, target: str, source: str) -> tuple[Pose2D, float]:
        """Look up the planar part of `newest`; raises as that does."""
        found, stamp = self.newest(target, source)
        return found.pose, stamp

    def _is_parent(self, frame: str) -> bool:
        return any(frame in above.parents for above in self._above.values())

    def _climb(self, frame: str, when: float, end: str) -> tuple[dict[str, Transform], _Outside | None]:
        """All frames from here up to `end` or the root, as frame_from_start; and the error that stopped it, if any."""
        found, total = {frame: IDENTITY}, IDENTITY
        while frame != end:
            above = self._above.get(frame)
            if above is None:
                return found, None
            entry = above.at(when)
            if isinstance(entry, _Outside):
                return found, entry._replace(frame=frame)
            parent, place = entry
            total = _compose(place, total)
            if parent in found:
                return found, None  # a loop
            found[parent] = total
            frame = parent
        return found, None

    def _newest_common(self, target: str, source: str) -> float:
        """Newest time at which all transforms between two frames are known, 0 if none of them moves."""
        rising, falling = self._line_above(source), self._line_above(target)
        meeting = next((frame for frame in rising if frame in falling), None)
        stamps = [
            above.newest
            for line in (rising, falling)
            for frame in (line[: line.index(meeting)] if meeting is not None else line)
            if isinstance(above := self._above.get(frame), _Moving)
        ]
        return min(stamps, default=0.0)

    def _line_above(self, frame: str) -> list[str]:
        line = [frame]
        while frame in self._above:
            frame = self._above[frame].newest_parent
            if frame in line:
                break
            line.append(frame)
        return line

    def _unknown(self, target: str, source: str, outside: _Outside | None) -> TransformError:
        for frame in (target, source):
            if frame not in self._above and not self._is_parent(frame):
                return TransformNotYet(target, source, f"nothing was told of the frame '{frame}'")
        if outside is None:
            return TransformNotYet(target, source, "they are not connected")
        what = f"'{outside.frame}' is known from {outside.first:.3f} to {outside.last:.3f} s, not at {outside.at:.3f} s"
        return (TransformTooOld if outside.at < outside.first else TransformNotYet)(target, source, what)


class _Outside(NamedTuple):
    """A time without a transform, and the span of those stored [s]."""

    at: float
    first: float
    last: float
    frame: str = ""


class _Static:
    """One transform for all time."""

    def __init__(self, parent: str, place: Transform) -> None:
        self.newest_parent, self._place = parent, place
        self.parents = {parent}

    def at(self, _when: float) -> tuple[str, Transform]:
        return self.newest_parent, self._place


class _Moving:
    """The transforms of one frame over time."""

    def __init__(self, cache_s: float) -> None:
        self._cache_s = cache_s
        self._stamps: list[float] = []
        self._entries: list[tuple[str, Transform]] = []
        self.parents: set[str] = set()

    @property
    def newest(self) -> float:
        return self._stamps[-1]

    @property
    def newest_parent(self) -> str:
        return self._entries[-1][0]

    def add(self, stamp: float, parent: str, place: Transform) -> str:
        stamps = self._stamps
        if stamps and stamp < stamps[-1] - self._cache_s:
            return "it is older than all that is kept"
        i = bisect_left(stamps, stamp)
        if i < len(stamps) and stamps[i] == stamp:
            return "there is one of that time already"
        stamps.insert(i, stamp)
        self._entries.insert(i, (parent, place))
        self.parents.add(parent)
        old = bisect_left(stamps, stamps[-1] - self._cache_s)
        if old:
            del stamps[:old], self._entries[:old]
        return ""

    def at(self, when: float) -> tuple[str, Transform] | _Outside:
        stamps = self._stamps
        i = bisect_right(stamps, when) - 1  # the newest one not later
        if i < 0 or (i == len(stamps) - 1 and stamps[i] != when):
            return _Outside(when, stamps[0], stamps[-1])
        parent, place = self._entries[i]
        if stamps[i] == when or self._entries[i + 1][0] != parent:  # a new parent: no interpolation
            return parent, place
        share = (when - stamps[i]) / (stamps[i + 1] - stamps[i])
        return parent, _between(place, self._entries[i + 1][1], share)


def _problem(edge: Edge, parent: str, child: str) -> str:
    """Reason why a transform is invalid, "" if it is valid."""
    if not parent or not child:
        return "a frame has no name"
    if parent == child:
        return f"'{child}' is its own parent"
    length = math.hypot(edge.qx, edge.qy, edge.qz, edge.qw)
    if not (math.isfinite(edge.x + edge.y + edge.z) and abs(length * length - 1.0) <= UNIT_WITHIN):
        return f"'{child}' has a place or a turn that makes no sense"
    return ""


def _between(a: Transform, b: Transform, share: float) -> Transform:
    """Interpolate: linearly for the position, on the shortest arc for the rotation."""
    rest = 1.0 - share
    dot = a.qx * b.qx + a.qy * b.qy + a.qz * b.qz + a.qw * b.qw
    angle = math.acos(min(abs(dot), 1.0))
    sine = math.sin(angle)
    if sine < 1e-9:
        turn = a[3:]
    else:
        ka, kb = math.sin(rest * angle) / sine, math.copysign(math.sin(share * angle), dot) / sine
        turn = (ka * a.qx + kb * b.qx, ka * a.qy + kb * b.qy, ka * a.qz + kb * b.qz, ka * a.qw + kb * b.qw)
    return Transform(rest * a.x + share * b.x, rest * a.y + share * b.y, rest * a.z + share * b.z, *turn)


def _rotate(turn: Transform, x: float, y: float, z: float) -> tuple[float, float, float]:
    _, _, _, qx, qy, qz, qw = turn
    ux, uy, uz = 2.0 * (qy * z - qz * y), 2.0 * (qz * x - qx * z), 2.0 * (qx * y - qy * x)
    return x + qw * ux + qy * uz - qz * uy, y + qw * uy + qz * ux - qx * uz, z + qw * uz + qx * uy - qy * ux


def _compose(a: Transform, b: Transform) -> Transform:
    if b is IDENTITY:
        return a
    x, y, z = _rotate(a, b.x, b.y, b.z)
    return Transform(
        a.x + x,
        a.y + y,
        a.z + z,
        a.qw * b.qx + a.qx * b.qw + a.qy * b.qz - a.qz * b.qy,
        a.qw * b.qy - a.qx * b.qz + a.qy * b.qw + a.qz * b.qx,
        a.qw * b.qz + a.qx * b.qy - a.qy * b.qx + a.qz * b.qw,
        a.qw * b.qw - a.qx * b.qx - a.qy * b.qy - a.qz * b.qz,
    )


def _invert(a: Transform) -> Transform:
    back = Transform(0.0, 0.0, 0.0, -a.qx, -a.qy, -a.qz, a.qw)
    x, y, z = _rotate(back, a.x, a.y, a.z)
    return Transform(-x, -y, -z, *back[3:])
