"""A sendmail program (Postfix, sendmail, msmtp, ...); recipients are arguments, never read from the text."""

from __future__ import annotations

import os
import subprocess
from email.policy import SMTP

from rosbot_patrol.alerts.channels.channel import DeliveryError, FailureCause
from rosbot_patrol.alerts.channels.mail import Envelope, build_mail
from rosbot_patrol.alerts.outbox.notice import Notice

SENDMAILS = ("/usr/sbin/sendmail", "/usr/lib/sendmail")
_OF_RECIPIENT = {67, 68}  # sysexits.h: no such user, no such host
_PERMANENT_EXITS = {65, *_OF_RECIPIENT}  # 65: data error


class SendmailTransport:
    """Hands mails to the program.

    Args:
        program: its path.
        envelope: sender and one recipient, since the program answers once for all recipients.
        timeout: it has to end within [s].
    """

    name = "sendmail"

    def __init__(self, program: str, envelope: Envelope, timeout: float) -> None:
        self.program, self._envelope = program, envelope
        self._sender, self._to = envelope.sender.addr_spec, envelope.recipient
        self._timeout = timeout

    def describe(self) -> str:
        """Where its mails go."""
        return f"{self._to} through {self.program}"

    def send(self, notice: Notice) -> str:
        """Hand the mail to the program."""
        command = [self.program, "-i", "-f", self._sender, "--", self._to]
        data = build_mail(notice, self._envelope).as_bytes(policy=SMTP.clone(linesep="\n"))
        try:
            done = subprocess.run(command, input=data, capture_output=True, timeout=self._timeout, check=False)
        except subprocess.TimeoutExpired as err:
            raise DeliveryError(f"{self.program} did not end within {self._timeout:g} s") from err
        except OSError as err:
            raise DeliveryError(f"{self.program} cannot be run: {err.strerror}") from err
        if done.returncode != 0:
            said = " ".join(done.stderr.decode("utf-8", "replace").split())[-300:] or "without a word"
            of_recipient = done.returncode in _OF_RECIPIENT
            raise DeliveryError(
                f"{self.program} ended with {done.returncode}: {said}",
                permanent=done.returncode in _PERMANENT_EXITS,
                of_recipient=of_recipient,
                cause=FailureCause.RECIPIENT if of_recipient else FailureCause.OTHER,
            )
        return self._to


def find_sendmail(given: str) -> str | None:
    """Path of the sendmail program, None if there is none."""
    candidates = (given,) if given else SENDMAILS
    return next((path for path in candidates if os.access(path, os.X_OK)), None)
