"""Trying a channel: a real notice that says that it is a test, and what became of it in plain words."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from dataclasses import dataclass

from PIL import Image, ImageDraw

from rosbot_patrol.alerts.channels.channel import Channel, DeliveryError
from rosbot_patrol.alerts.post.notice import Notice

_WHAT_TO_DO = {
    "DNS": "Look at the host's name in the configuration, and whether this machine has a network and a name server.",
    "Connection refused": "Look at host and port, and whether the server runs.",
    "TLS certificate": "Look at the host's name, or name the certificate that signed the server's as ca_file.",
    "does not speak TLS": "Look at port and security: tls is usual on 465, starttls on 587 and 25.",
    "STARTTLS": "The server offers no encryption on this port: try security: tls with port 465, or another server.",
    "refused the login": "Look at user and password; many providers want a password for applications.",
    "no answer within": "A firewall or a wrong port keeps silent like this; providers often block port 25, try 587.",
    "refused the recipient": "Look at the recipient's address.",
    "redirects are not followed": "Name the address that the server redirects to.",
    "answered 401": "The address wants a token, or another one: token_file.",
    "answered 403": "The server does not take the signature or the token: look at secret_file and token_file.",
    "answered 404": "Look at the path of the url.",
}


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What became of a test notice on one channel."""

    channel: str
    is_taken: bool
    text: str
    seconds: float

    @property
    def advice(self) -> str:
        """What to look at, "" where there is nothing to say."""
        if self.is_taken:
            return ""
        return next((advice for words, advice in _WHAT_TO_DO.items() if words in self.text), "")


def try_channel(channel: Channel, notice: Notice, clock: Callable[[], float] = time.monotonic) -> Trial:
    """Send a notice through a channel, past the outbox."""
    began = clock()
    try:
        where = channel.transport.send(notice)
    except DeliveryError as err:
        return Trial(channel=channel.name, is_taken=False, text=str(err), seconds=clock() - began)
    return Trial(channel=channel.name, is_taken=True, text=where, seconds=clock() - began)


def trial_notice(wall: float, host: str) -> Notice:
    """A notice that says that it is a test."""
    stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(wall))
    return Notice(
        id=f"{stamp}-test{int(wall * 1000) % 1000:03d}",
        wall=wall,
        kind="test",
        subject="rosbot patrol: a test",
        text=f"This is a test from the robot on {host}. Nothing happened.\n\nA notice about an intruder would come by"
        " the same way, with the camera's picture in the place of this one.",
        facts=(
            ("Time", time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(wall))),
            ("Letters", "Küche, salón, кухня, 台所, 🚪: do they look right?"),
        ),
        picture=_picture(),
        picture_name="test.jpg",
    )


def _picture() -> bytes:
    image = Image.new("RGB", (480, 270), (36, 86, 107))
    draw = ImageDraw.Draw(image)
    for i in range(16):
        draw.rectangle((i * 30, 200, i * 30 + 29, 269), fill=(16 * i, 120, 255 - 16 * i))
    draw.text((150, 90), "rosbot patrol: a test picture", fill=(255, 255, 255))
    out = io.BytesIO()
    image.save(out, "JPEG", quality=85)
    return out.getvalue()
