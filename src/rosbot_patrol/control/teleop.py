"""Keys to velocities, as in teleop_twist_keyboard."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from rosbot_patrol.params import param

CTRL_C = "\x03"

# key: forward, left, up, turn
MOVES: dict[str, tuple[int, int, int, int]] = {
    "i": (1, 0, 0, 0),
    "o": (1, 0, 0, -1),
    "j": (0, 0, 0, 1),
    "l": (0, 0, 0, -1),
    "u": (1, 0, 0, 1),
    ",": (-1, 0, 0, 0),
    ".": (-1, 0, 0, 1),
    "m": (-1, 0, 0, -1),
    "O": (1, -1, 0, 0),
    "I": (1, 0, 0, 0),
    "J": (0, 1, 0, 0),
    "L": (0, -1, 0, 0),
    "U": (1, 1, 0, 0),
    "<": (-1, 0, 0, 0),
    ">": (-1, -1, 0, 0),
    "M": (-1, 1, 0, 0),
    "t": (0, 0, 1, 0),
    "b": (0, 0, -1, 0),
}

# key: factor of the speed, factor of the turning
SPEEDS: dict[str, tuple[float, float]] = {
    "q": (1.1, 1.1),
    "z": (0.9, 0.9),
    "w": (1.1, 1.0),
    "x": (0.9, 1.0),
    "e": (1.0, 1.1),
    "c": (1.0, 0.9),
}

HELP = """
Keys, hold or repeat them to drive:
     u    i    o
     j    k    l
     m    ,    .
With shift they move sideways where the base can. t up, b down; any other key stops.

q/z  all speeds 10 % up/down
w/x  speed only
e/c  turning only

Ctrl-C ends
"""


@dataclass(frozen=True, kw_only=True)
class TeleopParams:
    """Parameters of teleop_twist_keyboard."""

    speed: float = param(0.5, lo=0.0, unit="m/s", doc="initial speed")
    turn: float = param(1.0, lo=0.0, unit="rad/s", doc="initial turning speed")
    speed_limit: float = param(1000.0, lo=0.0, unit="m/s", doc="maximum speed that can be set")
    turn_limit: float = param(1000.0, lo=0.0, unit="rad/s", doc="maximum turning speed that can be set")
    repeat_rate: float = param(
        0.0, lo=0.0, hi=1000.0, unit="1/s", doc="rate at which the last command is repeated; 0: never"
    )
    key_timeout: float = param(0.0, lo=0.0, unit="s", doc="time after the last key at which the robot stops; 0: never")
    stamped: bool = param(False, doc="publish TwistStamped")
    frame_id: str = param("", doc="frame of a TwistStamped")


class Velocity(NamedTuple):
    """What to publish: forward, left, up [m/s], turning [rad/s]."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    turn: float = 0.0


class KeyTeleop:
    """Turns keys into velocities.

    Attributes:
        speed, turn: speeds that the next key commands [m/s], [rad/s].
        note: text for the operator, "" for none.
    """

    def __init__(self, params: TeleopParams) -> None:
        self._params = params
        self.speed = min(params.speed, params.speed_limit)
        self.turn = min(params.turn, params.turn_limit)
        self.note = ""
        self._direction = (0, 0, 0, 0)

    def press(self, key: str) -> Velocity | None:
        """Velocity after a key; "" stands for a time-out; None: publish nothing."""
        self.note = ""
        if key in SPEEDS:
            self._change_speed(*SPEEDS[key])
        elif key in MOVES:
            self._direction = MOVES[key]
        elif key == "" and not any(self._direction):
            return None
        else:
            self._direction = (0, 0, 0, 0)
        x, y, z, turn = self._direction
        return Velocity(x * self.speed, y * self.speed, z * self.speed, turn * self.turn)

    def _change_speed(self, speed_factor: float, turn_factor: float) -> None:
        p = self._params
        self.speed = min(self.speed * speed_factor, p.speed_limit)
        self.turn = min(self.turn * turn_factor, p.turn_limit)
        self.note = f"currently:\tspeed {self.speed:.3g}\tturn {self.turn:.3g}"
        if self.speed == p.speed_limit and speed_factor > 1.0:
            self.note += "\n(the speed limit is reached)"
        if self.turn == p.turn_limit and turn_factor > 1.0:
            self.note += "\n(the turning limit is reached)"
