"""Mail server that stores every mail in a file, and counts copies of each mail."""

from __future__ import annotations

import contextlib
import email
import email.policy
import itertools
import socketserver
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable
from pathlib import Path

from rosbot_patrol.campaign.crash_ledger import KeptMail
from rosbot_patrol.files import write_atomic

INCIDENT = "X-Rosbot-Patrol-Incident"


class MailSink:
    """SMTP server (RFC 5321, no extensions) on a local port; every mail is on the disk before it is acknowledged.

    Args:
        folder: folder of the mails.
        port: port of the server, 0: any.

    Raises:
        OSError: the port is taken.
    """

    def __init__(self, folder: Path, port: int = 0) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        numbers = itertools.count(len(list(folder.iterdir())) + 1)

        class Session(_Session):
            def keep(self, mail: bytes) -> None:
                write_atomic(folder / f"{next(numbers):06d}.eml", mail)

        class Server(socketserver.ThreadingTCPServer):
            allow_reuse_address = daemon_threads = True

        self._server = Server(("localhost", port), Session)
        self.port = int(self._server.server_address[1])
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def stop(self) -> None:
        """Stop accepting mails."""
        self._server.shutdown()
        self._server.server_close()


class _Session(socketserver.StreamRequestHandler, ABC):
    @abstractmethod
    def keep(self, mail: bytes) -> None:
        """Store a mail; when it returns, the mail is on the disk."""

    def handle(self) -> None:
        with contextlib.suppress(ConnectionError):
            self._talk()

    def _talk(self) -> None:
        self._say("220 campaign")
        while line := self.rfile.readline(2000):
            word = line[:4].upper()
            if word == b"DATA":
                self._say("354 go on")
                self.keep(b"".join(self._lines()))
                self._say("250 kept")
            elif word == b"QUIT":
                self._say("221 bye")
                return
            else:
                self._say(
                    "250 campaign" if word in (b"EHLO", b"HELO", b"MAIL", b"RCPT", b"RSET", b"NOOP") else "502 no"
                )

    def _lines(self) -> Iterable[bytes]:
        while line := self.rfile.readline(100_000):
            if line in (b".\r\n", b".\n"):
                return
            yield line[1:] if line.startswith(b"..") else line
        raise ConnectionError("the client went in the middle of a mail")

    def _say(self, text: str) -> None:
        self.wfile.write(text.encode() + b"\r\n")


def kept_mails(folders: Iterable[Path]) -> list[KeptMail]:
    """Mails about incidents in folders of files (a Maildir's `new`, or those above)."""
    found = []
    for folder in folders:
        for path in sorted(folder.iterdir()) if folder.is_dir() else []:
            mail = email.message_from_bytes(path.read_bytes(), policy=email.policy.default)
            incident = mail[INCIDENT]
            if incident:
                found.append(KeptMail(message_id=str(mail["Message-ID"]), incident=str(incident)))
    return found
