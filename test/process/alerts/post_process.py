"""A process to be killed: `post_process.py put FOLDER NAME` or `post_process.py deliver FOLDER MAILDIR PORT
[PUSH]`, where PUSH is the port of a server of ntfy's protocol."""

import itertools
import sys
import time
from pathlib import Path

from rosbot_patrol.alerts.channels.channel import Channel, Pace
from rosbot_patrol.alerts.channels.mail import make_envelope
from rosbot_patrol.alerts.channels.transports.apprise import AppriseTransport
from rosbot_patrol.alerts.channels.transports.maildir import MaildirTransport
from rosbot_patrol.alerts.channels.transports.smtp import SmtpServer, SmtpTransport
from rosbot_patrol.alerts.dispatch.dispatcher import Dispatcher
from rosbot_patrol.alerts.outbox.notice import Notice
from rosbot_patrol.alerts.outbox.outbox import Outbox

ENVELOPE = make_envelope("owner@example.org", "robot@example.org")
STALE = 3.0  # [s] without a sign of life


def put(folder, name):
    """Put notices for ever; a line on stdout is the promise that one is kept."""
    outbox = Outbox(folder)
    for i in itertools.count():
        own = {"id": f"{name}-{i}", "subject": f"{name}-{i}", "picture": b"\xff" * 20_000}
        notice = Notice(wall=1.79e9, kind="incident", text="t", **own)
        outbox.put(notice)
        print(notice.id, flush=True)


def deliver(folder, maildir, port, push=0):
    """Deliver for ever, on all channels."""
    pace = Pace(interval=0.0, first_delay=0.05)
    channels = [
        Channel(name="disk", transport=MaildirTransport(Path(maildir), ENVELOPE), pace=pace),
        Channel(name="mail", transport=SmtpTransport(SmtpServer(host="localhost", port=port), ENVELOPE), pace=pace),
    ]
    if push:
        transport = AppriseTransport(f"ntfy://127.0.0.1:{push}/topic", "push", 5.0)
        channels.append(Channel(name="push", transport=transport, pace=pace))
    dispatcher = Dispatcher(Outbox(folder), channels, stale_after=STALE)
    while not dispatcher.take_over():
        time.sleep(0.01)
    print("delivers", flush=True)
    while True:
        while not dispatcher.take_over():
            time.sleep(0.01)
        dispatcher.refresh()
        if not any(dispatcher.deliver(name) for name in dispatcher.channels):
            time.sleep(0.005)


if __name__ == "__main__":
    if sys.argv[1] == "put":
        put(Path(sys.argv[2]), sys.argv[3])
    else:
        deliver(Path(sys.argv[2]), sys.argv[3], *map(int, sys.argv[4:]))
