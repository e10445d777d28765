"""The ways to the owner, as the guard's nodes were started with them and with what the pages have added."""

from __future__ import annotations

import socket
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from rosbot_patrol.alerts.channels.channel import Channel
from rosbot_patrol.alerts.channels.channel_check import make_test_notice, try_channel
from rosbot_patrol.alerts.channels.config import Surroundings, make_channels
from rosbot_patrol.alerts.channels.params import MailParams
from rosbot_patrol.alerts.dispatch.settings_file import read_settings
from rosbot_patrol.console.house.files import HouseFiles
from rosbot_patrol.console.live.orders import Answer
from rosbot_patrol.errors import ParamError
from rosbot_patrol.patrol.house.own_files import CHANNELS


class Ways:
    """Makes the channels anew for each question.

    Args:
        state_dir: of the guard.
        house: files of the house.
        around: the machine.
    """

    def __init__(self, state_dir: Path, house: HouseFiles, around: Surroundings) -> None:
        self._outbox, self._house, self._around = state_dir / "outbox", house, around

    def described(self) -> Mapping[str, str]:
        """Where each way leads, by its name. Raises ParamError."""
        return {channel.name: channel.transport.describe() for channel in self._channels()}

    def test(self, name: str) -> Answer:
        """Send a test notice by one of them."""
        try:
            channel = next(channel for channel in self._channels() if channel.name == name)
        except StopIteration:
            return Answer(accepted=False, text=f"there is no way called {name}")
        except ParamError as err:
            return Answer(accepted=False, text=str(err))
        tested = try_channel(channel, make_test_notice(time.time(), socket.gethostname()))
        if tested.is_taken:
            return Answer(accepted=True, text=f"{name}: taken after {tested.seconds:.1f} s: {tested.text}")
        return Answer(accepted=False, text=f"{name}: {tested.text}. {tested.advice}".strip())

    def _channels(self) -> list[Channel]:
        known = read_settings(self._outbox) if self._outbox.is_dir() else []
        mail = known[0].mail if known else MailParams()
        own = self._house.path(CHANNELS)
        return make_channels(replace(mail, channels=str(own) if own.exists() else ""), self._around)
