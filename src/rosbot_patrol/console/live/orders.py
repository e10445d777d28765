"""Orders that people give: who may, and what is written down. What carries them out is given."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from rosbot_patrol.console.access.accounts import Account
from rosbot_patrol.console.access.door import Door
from rosbot_patrol.console.access.order_log import Order, OrderLog
from rosbot_patrol.console.words import later
from rosbot_patrol.errors import AccessError

log = logging.getLogger(__name__)

_PATIENCE = 6.0  # [s] for an answer
DISARMED = "disarmed"


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What came of an order, in one sentence."""

    accepted: bool
    text: str


class Robot(Protocol):
    """Carries orders out. Each call may block for some seconds."""

    def look(self, room_id: int) -> Answer:
        """Look at a room now."""

    def look_at_all(self) -> Answer:
        """Look at all rooms."""

    def home(self) -> Answer:
        """Give up what runs, and drive home."""

    def cancel(self) -> Answer:
        """Give up what runs; the robot stays where it is."""

    def stop(self, *, pressed: bool) -> Answer:
        """Press or release the emergency stop."""

    def arm(self, mode: str) -> Answer:
        """Change the mode."""

    def mute(self, room_id: int, seconds: float) -> Answer:
        """Let the sensors of a room start no mission for a while, 0: let them count again."""

    def drive_to(self, x: float, y: float) -> Answer:
        """Drive to a place in map [m]."""

    def drive(self, forward: float, turn: float) -> None:
        """Drive by hand: shares of the top speeds, from -1 to 1. Stands still 0.3 s after the last call."""


@dataclass(frozen=True, kw_only=True)
class Visitor:
    """Somebody at a page: their account when they came, and the address."""

    account: Account
    peer: str


class Desk:
    """Takes orders from the pages.

    Args:
        robot: carries them out.
        door: knows what people may do now.
        order_log: of all orders.
        wall: seconds since 1970.
    """

    def __init__(self, robot: Robot, door: Door, order_log: OrderLog, wall: Callable[[], float]) -> None:
        self._robot, self._door, self.order_log, self._wall = robot, door, order_log, wall

    async def look(self, visitor: Visitor, room_id: int, name: str) -> Answer:
        """Look at a room now."""
        return await self._give(visitor, f"look at room {room_id} ({name})", lambda: self._robot.look(room_id))

    async def look_at_all(self, visitor: Visitor) -> Answer:
        """Look at all rooms."""
        return await self._give(visitor, "look at all rooms", self._robot.look_at_all)

    async def home(self, visitor: Visitor) -> Answer:
        """Give up what runs, and drive home."""
        return await self._give(visitor, "drive home", self._robot.home)

    async def cancel(self, visitor: Visitor) -> Answer:
        """Give up what runs."""
        return await self._give(visitor, "give up what runs", self._robot.cancel)

    async def stop(self, visitor: Visitor, *, pressed: bool) -> Answer:
        """Press or release the emergency stop."""
        what = "press the emergency stop" if pressed else "release the emergency stop"
        return await self._give(visitor, what, lambda: self._robot.stop(pressed=pressed))

    async def arm(self, visitor: Visitor, mode: str, code: str = "") -> Answer:
        """Change the mode; disarming needs the alarm code, where one is set."""

        def arm() -> Answer:
            if mode == DISARMED:
                self._door.check_code(code, visitor.account)
            return self._robot.arm(mode)

        return await self._give(visitor, f"change the mode to {mode}", arm)

    async def mute(self, visitor: Visitor, room_id: int, name: str, seconds: float) -> Answer:
        """Let the sensors of a room start no mission for a while, 0: let them count again."""
        what = f"mute room {room_id} ({name}) for {seconds:g} s"
        return await self._give(visitor, what, lambda: self._robot.mute(room_id, seconds))

    async def drive_to(self, visitor: Visitor, x: float, y: float) -> Answer:
        """Drive to a place in map [m]."""
        return await self._give(visitor, f"drive to ({x:.1f}, {y:.1f})", lambda: self._robot.drive_to(x, y))

    def drive(self, visitor: Visitor, forward: float, turn: float) -> bool:
        """Drive by hand; False where the visitor may not."""
        now = self._door.present(visitor.account)
        if now is None or not now.role.may_order:
            return False
        self._robot.drive(min(max(forward, -1.0), 1.0), min(max(turn, -1.0), 1.0))
        return True

    def note(self, visitor: Visitor, what: str) -> None:
        """Write down something that needs no robot, such as a change of the people."""
        self._write(visitor, what, Answer(accepted=True, text="done"))

    def may(self, visitor: Visitor, *, manage: bool = False) -> bool:
        """Whether a visitor may give orders, or manage people, now."""
        now = self._door.present(visitor.account)
        return now is not None and (now.role.may_manage if manage else now.role.may_order)

    async def _give(self, visitor: Visitor, what: str, order: Callable[[], Answer]) -> Answer:
        if self._door.present(visitor.account) is None:
            answer = Answer(accepted=False, text=later("You are signed out: sign in again."))
        elif not self.may(visitor):
            answer = Answer(accepted=False, text=later("Guests give no orders."))
        else:
            answer = await _carried_out(order)
        await asyncio.to_thread(self._write, visitor, what, answer)  # a slow disk holds up no page
        return answer

    def _write(self, visitor: Visitor, what: str, answer: Answer) -> None:
        who = visitor.account.name
        order = Order(
            wall=self._wall(), who=who, peer=visitor.peer, what=what, accepted=answer.accepted, answer=answer.text
        )
        log.info("%s at %s: %s: %s", who, visitor.peer, what, answer.text)
        self.order_log.add(order)


async def _carried_out(order: Callable[[], Answer]) -> Answer:
    try:
        return await asyncio.wait_for(asyncio.to_thread(order), _PATIENCE)
    except AccessError as err:
        return Answer(accepted=False, text=f"{str(err)[:1].upper()}{str(err)[1:]}.")
    except TimeoutError:
        return Answer(accepted=False, text=later("The guard does not answer."))
