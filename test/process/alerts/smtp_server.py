"""A small SMTP server for tests, on a socket of port 0: keeps what it is given, or refuses as told."""

import socket
import threading
from email import message_from_bytes


class SmtpServer:
    """`replies` maps a verb (EHLO, MAIL, RCPT, DATA, ".", QUIT) to another reply; None closes the connection.

    `recipients` maps an address to what RCPT is answered for it, one after the other; the last stays.
    """

    def __init__(self, replies=None, silent=False, port=0, recipients=None):
        self.replies, self.recipients = replies or {}, {to: list(said) for to, said in (recipients or {}).items()}
        self.asked = []  # addresses of RCPT
        self.silent = silent
        self.mails, self.verbs = [], []
        self._socket = socket.create_server(("localhost", port))
        self.port = self._socket.getsockname()[1]
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *exc):
        self._socket.close()

    def _serve(self):
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            threading.Thread(target=self._talk, args=(connection,), daemon=True).start()

    def _talk(self, connection):
        with connection, connection.makefile("rwb") as stream:
            if self.silent:
                stream.read(1)
                return
            try:
                self._dialogue(stream)
            except (OSError, ValueError):
                return

    @property
    def took(self):
        """(recipient, Message-ID) of each mail."""
        return [
            (line[line.index("<") + 1 : line.index(">")], message_from_bytes(data)["Message-ID"])
            for envelope, data in self.mails
            for line in envelope
            if line.lower().startswith("rcpt")
        ]

    def _to(self, line):
        address = line[line.index("<") + 1 : line.index(">")]
        self.asked.append(address)
        said = self.recipients.get(address)
        if not said:
            return self.replies.get("RCPT", "250 ok")
        return said.pop(0) if len(said) > 1 else said[0]

    def _dialogue(self, stream):
        def say(verb, default):
            reply = self.replies.get(verb, default)
            if reply is None:
                raise OSError
            stream.write(reply.encode() + b"\r\n")
            stream.flush()

        say("", "220 test")
        envelope = []
        for line in stream:
            verb = line[:4].decode().strip().upper()
            self.verbs.append(verb)
            if verb == "DATA":
                say(verb, "354 go on")
                if not self.replies.get("DATA", "354").startswith("354"):
                    continue
                lines = []
                for text in stream:
                    if text == b".\r\n":
                        break
                    lines.append(text.removeprefix(b".") if text.startswith(b"..") else text)
                say(".", "250 taken")
                if self.replies.get(".", "250").startswith("250"):
                    self.mails.append((envelope, b"".join(lines)))
                envelope = []
                continue
            if verb == "RCPT":
                reply = self._to(line.decode())
                if reply is None:
                    raise OSError
                stream.write(reply.encode() + b"\r\n")
                stream.flush()
                if reply.startswith("421"):
                    raise OSError
                if reply.startswith("2"):
                    envelope.append(line.decode().strip())
                continue
            if verb == "MAIL":
                envelope = [line.decode().strip()]
            say(verb, "221 bye" if verb == "QUIT" else "250 ok")
