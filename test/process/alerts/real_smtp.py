"""aiosmtpd on a free port, on a thread of its own; can be stopped and started again on the same port."""

import asyncio
import socket
import threading
import time

from aiosmtpd.smtp import SMTP


class RealSmtp:
    """A real SMTP server; `mails` holds what it was given: sender, recipients, bytes, whether there was a login."""

    def __init__(self, port=0, ssl=None, **options):
        self.mails, self.times = [], []
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        listening = socket.create_server(("localhost", port))
        self.port = listening.getsockname()[1]
        options = {"hostname": "localhost", "loop": self._loop, **options}
        made = self._loop.create_server(lambda: SMTP(self, **options), sock=listening, ssl=ssl)
        self._server = asyncio.run_coroutine_threadsafe(made, self._loop).result(10)

    async def handle_DATA(self, server, session, envelope):  # aiosmtpd's name
        self.times.append(time.monotonic())
        self.mails.append((envelope.mail_from, envelope.rcpt_tos, envelope.content, session.authenticated))
        return "250 taken"

    def stop(self):
        if self._loop.is_running():
            self._loop.call_soon_threadsafe(self._server.close)
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(5)
