"""Every error that rosbot_patrol raises on purpose.

    PatrolError
    |- ParamError         a parameter or a key of a configuration file
    |- MapError           a map file or a grid that cannot be used
    |- WorldError         a world, robot or actor description of the simulator
    |- TransformError     a pose that is not available
    |  |- TransformNotYet  it may still come
    |  |- TransformTooOld  that time is no longer stored
    |  `- LaserTilted      a laser whose scan is no plan of the room
    |- BagError           a recorded bag that cannot be used
    |- ResultError        a stored result of a replay that cannot be used
    |- StateError         a file of the state folder that cannot be used
    |- PlanningError      no global plan
    |  |- StartOccupied
    |  |- GoalOccupied
    |  |- OutOfBounds
    |  `- NoPath
    |- ControlError       no velocity command
    |- ProtocolError      invalid bytes from a peer
    |- DeviceError        a device that does not answer, or cannot be had
    |- DetectorError      a network, its weights or a picture
    |- ImageError         invalid bytes of a picture
    |- SensorError        a sensor's message that cannot be used
    |- AlertError         a notice that could not be delivered
    |- HostError          a program, file or port of the machine that the set-up needs
    |- AccessError        a person, password or order that the console does not take
    `- StoreError         incidents that could not be kept or read

A constructor takes facts and writes the sentence, so that every message says what happened and where.
"""

from __future__ import annotations

import math


class PatrolError(Exception):
    """Base of all errors of this package."""


class ParamError(PatrolError):
    """A parameter or configuration key that cannot be used.

    Args:
        name: full name of the parameter, or "FILE: key".
        problem: what is wrong and what was expected.
    """

    def __init__(self, name: str, problem: str) -> None:
        super().__init__(f"{name}: {problem}")
        self.name = name
        self.problem = problem


class _FileError(PatrolError):
    def __init__(self, path: object, problem: str) -> None:
        super().__init__(f"{path}: {problem}")
        self.path = str(path)
        self.problem = problem


class MapError(_FileError):
    """A map (yaml, image or grid) that cannot be used: which file, and why."""


class WorldError(_FileError):
    """A world, robot or actor file of the simulator that cannot be used: which file, and why."""


class TransformError(PatrolError):
    """The pose of one frame in another is not known (yet)."""

    def __init__(self, target: str, source: str, problem: str) -> None:
        super().__init__(f"no transform from '{source}' to '{target}': {problem}")
        self.target = target
        self.source = source


class TransformNotYet(TransformError):
    """The pose may become known: a frame, or that time, has not arrived yet."""


class TransformTooOld(TransformError):
    """The pose will never be known: the time is before all that is stored."""


class LaserTilted(TransformError):
    """A laser is mounted too tilted for its scan to be laid into the plane of the floor.

    Args:
        target: frame in which it should be level.
        source: frame of the laser.
        tilt: angle between its plane and the floor [rad].
    """

    def __init__(self, target: str, source: str, tilt: float) -> None:
        PatrolError.__init__(
            self,
            f"the laser '{source}' is tilted by {math.degrees(tilt):.0f} deg in '{target}', so that its scan is no"
            " plan of the room: mount it level, or mend its transform",
        )
        self.target, self.source = target, source
        self.tilt = tilt


class BagError(_FileError):
    """A recorded bag that cannot be used: which file, which topic, and what to do."""


class ResultError(_FileError):
    """A stored result of a replay that cannot be used: which file, and why."""


class StateError(_FileError):
    """A file written by one of our programs that cannot be used now: which file, and why."""


class AccessError(PatrolError):
    """A person, password or order that the console does not take: what, and why."""

    def __init__(self, what: str, problem: str) -> None:
        super().__init__(f"{what} {problem}")
        self.what = what
        self.problem = problem


class PlanningError(PatrolError):
    """No global plan."""


class _AtPoint(PlanningError):
    _what = ""

    def __init__(self, x: float, y: float, reason: str = "is occupied") -> None:
        super().__init__(f"the {self._what} ({x:.2f}, {y:.2f}) {reason}")
        self.x = x
        self.y = y


class StartOccupied(_AtPoint):
    """The robot stands where the costmap has an obstacle."""

    _what = "start"


class GoalOccupied(_AtPoint):
    """The goal lies in an obstacle."""

    _what = "goal"


class OutOfBounds(PlanningError):
    """A point lies off the costmap.

    Args:
        what: "start" or "goal".
        x: where it lies [m].
        y: where it lies [m].
        covers: lowest and highest x and y of the costmap [m], where known.
    """

    def __init__(self, what: str, x: float, y: float, covers: tuple[float, float, float, float] | None = None) -> None:
        extent = ""
        if covers is not None:
            extent = ", which now reaches from ({:.1f}, {:.1f}) to ({:.1f}, {:.1f})".format(*covers)
        super().__init__(f"the {what} ({x:.2f}, {y:.2f}) is off the global costmap{extent}")
        self.what = what
        self.x = x
        self.y = y


class NoPath(PlanningError):
    """Start and goal are free, but not connected; the reason names the obstacle."""

    def __init__(self, start: tuple[float, float], goal: tuple[float, float], reason: str = "") -> None:
        ends = f"no way from ({start[0]:.2f}, {start[1]:.2f}) to ({goal[0]:.2f}, {goal[1]:.2f})"
        super().__init__(f"{ends}: {reason}" if reason else ends)
        self.start = start
        self.goal = goal


class ControlError(PatrolError):
    """No safe velocity command was found."""


class ProtocolError(PatrolError):
    """A peer sent bytes that the protocol does not allow.

    Args:
        peer: sender ("" if the caller adds it).
        problem: what is wrong with them.
    """

    def __init__(self, peer: str, problem: str) -> None:
        super().__init__(f"{peer}: {problem}" if peer else problem)
        self.peer = peer
        self.problem = problem


class HostError(PatrolError):
    """A program, file or port of this machine that cannot be used.

    Args:
        what: its name, path or command.
        problem: what is wrong, and what to do.
    """

    def __init__(self, what: str, problem: str) -> None:
        super().__init__(f"{what}: {problem}")
        self.what = what
        self.problem = problem


class DeviceError(PatrolError):
    """A device that does not answer, or cannot be had.

    Args:
        device: its port, address or name.
        problem: what is wrong, and what to do.
    """

    def __init__(self, device: str, problem: str) -> None:
        super().__init__(f"{device}: {problem}")
        self.device = device
        self.problem = problem


class DetectorError(PatrolError):
    """A network file or a picture that the detector cannot use."""


class ImageError(PatrolError):
    """The bytes of a picture, raw or compressed, that cannot be read."""


class SensorError(PatrolError):
    """A message of a sensor that cannot be used."""


class AlertError(PatrolError):
    """A transport did not accept a notice."""


class StoreError(PatrolError):
    """The incidents' files or index do not do what they should.

    Args:
        path: of the file or folder.
        problem: what is wrong with it.
        is_full: the disk has no room, or no more than it may use.
        is_corrupt: the file is damaged, so that trying again is of no use.
    """

    def __init__(self, path: object, problem: str, *, is_full: bool = False, is_corrupt: bool = False) -> None:
        super().__init__(f"{path}: {problem}")
        self.path = str(path)
        self.problem = problem
        self.is_full = is_full
        self.is_corrupt = is_corrupt
