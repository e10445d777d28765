"""The channels: the tutorial's own from the parameters, more from a file.

channels:
  phone:
    type: webhook
    url: https://hass.example.org/api/webhook/patrol
    secret_file: ~/.config/rosbot_patrol/webhook_secret
    kinds: [incident, fault]
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import urlsplit

from rosbot_patrol.alerts.channels.channel import Channel, Pace, Transport
from rosbot_patrol.alerts.channels.mail import Envelope, make_envelope
from rosbot_patrol.alerts.channels.network_words import is_loopback
from rosbot_patrol.alerts.channels.params import (
    PASSWORD_VARIABLE,
    SPECS,
    AppriseSpec,
    ChannelSpec,
    MaildirSpec,
    MailParams,
    SendmailSpec,
    SmtpSpec,
    WebhookSpec,
)
from rosbot_patrol.alerts.channels.secrets_on_disk import read_secret, refuse_secrets, warn_where_open
from rosbot_patrol.alerts.channels.transports.apprise import AppriseTransport, NoService
from rosbot_patrol.alerts.channels.transports.maildir import MaildirTransport
from rosbot_patrol.alerts.channels.transports.sendmail import SENDMAILS, SendmailTransport, find_sendmail
from rosbot_patrol.alerts.channels.transports.smtp import SmtpServer, SmtpTransport
from rosbot_patrol.alerts.channels.transports.webhook import WebAddress, WebhookTransport
from rosbot_patrol.errors import ParamError
from rosbot_patrol.params import load_strict, unknown_name
from rosbot_patrol.yaml_files import read_mapping

DEFAULT = "mail"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,39}")


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """What channels need of the machine: ROS's home, the environment, the host's name."""

    home: Path
    environ: Mapping[str, str]
    host: str = "localhost"


def make_channels(params: MailParams, around: Surroundings, *, prefix: str = "~") -> list[Channel]:
    """The default channel of the parameters, and those of the file, in which one called `mail` replaces it.

    Args:
        params: checked.
        around: the machine.
        prefix: of the parameters' names in messages.

    Raises:
        ParamError: names the parameter, or file and key.
    """
    more = load_channels(Path(params.channels).expanduser(), around) if params.channels else []
    channels = [] if any(DEFAULT in c.names for c in more) else _default_channels(params, around, prefix)
    channels += more
    if not any(not channel.kinds or "incident" in channel.kinds for channel in channels):
        raise ParamError(params.channels, "no channel takes the kind 'incident': nobody would be told of an intruder")
    return channels


def load_channels(path: Path, around: Surroundings) -> list[Channel]:
    """The channels of a file; raises ParamError."""
    tree = read_mapping(path, keys="channels", is_secret=True)  # the addresses of webhooks are secrets
    for key in tree:
        if key != "channels":
            raise ParamError(f"{path}: {key}", unknown_name(str(key), ["channels"]))
    channels = tree.get("channels")
    if not isinstance(channels, dict) or not channels:
        raise ParamError(f"{path}: channels", "expected one group of keys for each channel")
    made = [_channels(str(name), given, f"{path}: channels/", around) for name, given in channels.items()]
    found = [channel for several in made for channel in several]
    if any(channel.transport.name == WebhookTransport.name for channel in found):
        warn_where_open(path, "the address of a webhook")
    return found


def _channels(name: str, given: Any, prefix: str, around: Surroundings) -> list[Channel]:
    if not _NAME.fullmatch(name):
        raise ParamError(prefix + name, "expected a name of letters, digits, - and _")
    prefix = f"{prefix}{name}/"
    if not isinstance(given, dict):
        raise ParamError(prefix, f"expected a group of keys, got {_shown(given)}")
    refuse_secrets(given, name=prefix, place="in this file")
    kind = given.get("type")
    if not isinstance(kind, str) or kind not in SPECS:
        expected = f"expected one of {', '.join(SPECS)}"
        problem = f"is missing, {expected}" if kind is None else f"is {_shown(kind)}, {expected}"
        raise ParamError(f"{prefix}type", problem)
    if not isinstance(given.get("url", ""), str):
        raise ParamError(f"{prefix}url", f"expected a text, got {_shown(given['url'])}")
    spec = load_strict(SPECS[kind], given, name=prefix)
    return _one_each(name, _Maker(prefix, around).make(spec, name), spec)


def _shown(value: Any) -> str:
    """A value of the file for a message; if it could hold a web address, its type only."""
    is_short = isinstance(value, (str, int, float, type(None))) and "/" not in str(value)
    return repr(value)[:40] if is_short else f"something else ({type(value).__name__})"


def _one_each(name: str, transports: Mapping[str, Transport], spec: ChannelSpec) -> list[Channel]:
    """A channel for each recipient, so that each has a queue, a back-off and receipts of its own."""
    pace, kinds = Pace(interval=spec.interval, first_delay=spec.retry), tuple(spec.kinds)
    if len(transports) == 1:
        return [Channel(name=name, transport=t, kinds=kinds, pace=pace, recipient=to) for to, t in transports.items()]
    return [
        Channel(name=f"{name}:{to}", transport=t, kinds=kinds, pace=pace, recipient=to, group=name)
        for to, t in transports.items()
    ]


def _default_channels(params: MailParams, around: Surroundings, prefix: str) -> list[Channel]:
    names = {
        "to": "email_to", "from": "email_from", "program": "sendmail", "security": "smtp_security",
        "user": "smtp_user", "password_file": "smtp_password_file", "allow_plaintext": "smtp_allow_plaintext",
    }  # fmt: skip
    maker = _Maker(prefix, around, names)
    envelope = maker.envelope(params.email_to, params.email_from)
    kind = params.transport
    if kind == "auto":
        kind = "sendmail" if envelope.is_real and find_sendmail(params.sendmail) else "maildir"
    common: dict[str, Any] = {"type": kind, "timeout": params.mail_timeout}
    common |= {"interval": params.mail_interval, "retry": params.mail_retry}
    common |= {"to": params.email_to, "sender": params.email_from, "style": params.mail_style}
    specs: dict[str, ChannelSpec] = {
        "maildir": MaildirSpec(**common, folder=params.maildir),
        "sendmail": SendmailSpec(**common, program=params.sendmail),
        "smtp": SmtpSpec(
            **common,
            host=params.smtp_host,
            port=params.smtp_port,
            security=params.smtp_security,
            user=params.smtp_user,
            password_file=params.smtp_password_file,
            password_env=PASSWORD_VARIABLE,
            ca_file=params.smtp_ca_file,
            allow_plaintext=params.smtp_allow_plaintext,
        ),
    }
    return _one_each(DEFAULT, maker.make(specs[kind], DEFAULT), specs[kind])


class _Maker:
    """Makes transports, and knows the names of their keys for messages."""

    _same: ClassVar[Mapping[str, str]] = {}

    def __init__(self, prefix: str, around: Surroundings, names: Mapping[str, str] | None = None) -> None:
        self._prefix, self._around, self._names = prefix, around, names or self._same

    def make(self, spec: ChannelSpec, name: str) -> dict[str, Transport]:
        """The transports of a channel by recipient, "" for one without recipients; raises ParamError."""
        if isinstance(spec, MaildirSpec):
            folder = Path(spec.folder).expanduser() if spec.folder else self._around.home / "rosbot_patrol" / "mail"
            return {"": MaildirTransport(folder, self._styled(spec))}
        if isinstance(spec, SendmailSpec):
            return self._sendmail(spec)
        if isinstance(spec, SmtpSpec):
            return self._smtp(spec)
        if isinstance(spec, WebhookSpec):
            return {"": self._webhook(spec, name)}
        if isinstance(spec, AppriseSpec):
            return {"": self._apprise(spec, name)}
        raise TypeError(type(spec))

    def envelope(self, to: str, sender: str) -> Envelope:
        """Sender and recipients; raises ParamError."""
        return make_envelope(to, sender, names=(self._name("to"), self._name("from")), host=self._around.host)

    def _name(self, key: str) -> str:
        return self._prefix + self._names.get(key, key)

    def _styled(self, spec: MaildirSpec | SendmailSpec | SmtpSpec) -> Envelope:
        return replace(self.envelope(spec.to, spec.sender), is_tutorial=spec.style == "tutorial")

    def _real_envelope(self, spec: SendmailSpec | SmtpSpec, kind: str) -> Envelope:
        envelope = self._styled(spec)
        if not envelope.is_real:
            raise ParamError(self._name("to"), f"expected a real address for {kind}, got {spec.to!r}")
        return envelope

    def _sendmail(self, spec: SendmailSpec) -> dict[str, Transport]:
        envelope = self._real_envelope(spec, "sendmail")
        program = find_sendmail(spec.program)
        if program is None:
            raise ParamError(self._name("program"), f"no program at {spec.program or ' or '.join(SENDMAILS)}")
        return {copy.recipient: SendmailTransport(program, copy, spec.timeout) for copy in envelope.copies()}

    def _smtp(self, spec: SmtpSpec) -> dict[str, Transport]:
        envelope = self._real_envelope(spec, "smtp")
        if spec.user and spec.security not in ("starttls", "tls"):
            self._check_plain_login(spec)
        server = SmtpServer(
            host=spec.host,
            port=spec.port,
            security=spec.security,
            user=spec.user,
            password=self._secret("password", spec.password_file, spec.password_env) if spec.user else "",
            timeout=spec.timeout,
            ca_file=self._ca_file(spec.ca_file),
        )
        return {copy.recipient: SmtpTransport(server, copy) for copy in envelope.copies()}

    def _check_plain_login(self, spec: SmtpSpec) -> None:
        allow = self._names.get("allow_plaintext", "allow_plaintext")
        if spec.security == "none" and (spec.allow_plaintext or is_loopback(spec.host)):
            return
        problem = f"expected starttls or tls where {self._names.get('user', 'user')} is given"
        if spec.security == "none":
            problem += f": without, everybody on the way reads the login; {allow}: true sends it all the same"
        raise ParamError(self._name("security"), problem)

    def _webhook(self, spec: WebhookSpec, name: str) -> Transport:
        secret = spec.secret_file or spec.secret_env
        token = spec.token_file or spec.token_env
        parts = urlsplit(spec.url)
        if token and parts.scheme == "http" and not (spec.allow_plaintext or is_loopback(parts.hostname or "")):
            raise ParamError(
                self._name("url"),
                f"expected https://{parts.netloc}/... where a token is given: over http everybody on the way reads it;"
                " allow_plaintext: true sends it all the same",
            )
        address = WebAddress(
            url=spec.url,
            name=name,
            secret=self._secret("secret", spec.secret_file, spec.secret_env) if secret else "",
            token=self._secret("token", spec.token_file, spec.token_env) if token else "",
            with_picture=spec.picture,
            timeout=spec.timeout,
            ca_file=self._ca_file(spec.ca_file),
        )
        return WebhookTransport(address)

    def _apprise(self, spec: AppriseSpec, name: str) -> Transport:
        key, url = self._name("url_file"), self._secret("url", spec.url_file, spec.url_env)
        try:
            return AppriseTransport(url, name, spec.timeout, with_picture=spec.picture)
        except NoService:
            problem = "holds no address that Apprise knows: see https://github.com/caronc/apprise for each service's"
            raise ParamError(key, problem) from None
        except ImportError as err:
            raise ParamError(key, f"needs Apprise, which is not installed ({err}): run scripts/bootstrap") from err

    def _secret(self, what: str, file: str, variable: str) -> str:
        return read_secret(self._name(f"{what}_file"), file, variable, self._around.environ)

    def _ca_file(self, given: str) -> str:
        path = os.path.expanduser(given)
        if path and not os.access(path, os.R_OK):
            raise ParamError(self._name("ca_file"), f"{path} cannot be read")
        return path
