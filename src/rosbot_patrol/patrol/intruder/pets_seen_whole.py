"""What moves, is shown whole to the camera, and is taken for nobody: a pet, or a vacuum cleaner.

A detector that is right about pets says nothing of them, so that nobody tells whose legs those were that stood right
before the camera. Here the lidar tells: a thing that it follows, and that some pictures showed from so far off that a
person would be seen whole, without a box of a person there, is none.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence

from rosbot_patrol.geometry import angle_difference
from rosbot_patrol.patrol.intruder.close_ups import SeenAt
from rosbot_patrol.patrol.intruder.lidar_motion import LidarTrack
from rosbot_patrol.patrol.intruder.second_looks import shows_whole
from rosbot_patrol.patrol.records.inputs import Box, Eye
from rosbot_patrol.patrol.visibility.coverage import Sight

_PICTURES = 8  # in a row, of the same thing
_LATE = 0.5  # a thing that the lidar has not seen for so long is not where it was [s]
_BESIDE = 0.15  # a box that begins so far beside a thing is of another [rad]
_KEPT = 20


class PetsSeenWhole:
    """Those of one mission."""

    def __init__(self) -> None:
        self._sightings: deque[SeenAt] = deque(maxlen=_KEPT)

    @property
    def sightings(self) -> Sequence[SeenAt]:
        """Where something was that is no person."""
        return tuple(self._sightings)

    def look(self, now: float, eye: Eye, sight: Sight, boxes: Iterable[Box], tracks: Iterable[LidarTrack]) -> None:
        """Take in a picture.

        Args:
            now: [s].
            eye: the camera when it was taken.
            sight: how far one could look from there.
            boxes: all that the detector found in it.
            tracks: of what the lidar follows.
        """
        people = [box for box in boxes if box.label == "person"]
        for track in tracks:
            if not track.has_moved or now - track.at > _LATE or not shows_whole(eye, sight, track.x, track.y):
                continue
            track.shown = 0 if any(_is_of(box, eye, track) for box in people) else track.shown + 1
            if track.shown >= _PICTURES:
                self._sightings.append(SeenAt(track.x, track.y, now))


def _is_of(box: Box, eye: Eye, track: LidarTrack) -> bool:
    bearing = math.atan2(track.y - eye.pose.y, track.x - eye.pose.x)
    ahead = angle_difference(bearing, eye.pose.yaw)
    return eye.bearing(box.xmax) - _BESIDE <= ahead <= eye.bearing(box.xmin) + _BESIDE
