"""A small SMTP server for tests, on a socket of port 0: keeps what it is given, or refuses as told."""

import socket
import threading


class SmtpServer:
    """`replies` maps a verb (EHLO, MAIL, RCPT, DATA, ".", QUIT) to another reply; None closes the connection."""

    def __init__(self, replies=None, silent=False, port=0):
        self.replies = replies or {}
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
            if verb in ("MAIL", "RCPT"):
                envelope.append(line.decode().strip())
            say(verb, "221 bye" if verb == "QUIT" else "250 ok")
