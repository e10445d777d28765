"""A zip file for a bug report: what the developers need to know, with secrets taken out.

Passwords, keys, addresses of people and of web services become "***". Its README.txt lists what it holds, so that its
owner can look before it is sent.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path

_HIDDEN = "***"
_README = """\
A report of rosbot_patrol, for its developers. Please look through it before you send it.

It holds the files below. Passwords, keys, mail addresses, web addresses of services and names of people were replaced
by ***. Pictures of the camera are not in it.
"""
# key: value, key=value, "key": "value", of keys that are secret or personal
_KEYS = re.compile(
    r"(?i)(?P<key>[\"']?[\w./~-]*(?:password|passwd|passphrase|secret|token|api_?key|email_to|email_from|smtp_user|url|"
    r"peers|user)\w*[\"']?\s*[:=]\s*)(?P<value>\"[^\"]*\"|'[^']*'|[^\s,}\]]+)"
)
_KEPT = re.compile(r"(?i)(url_file|_file|_env|console/url|~url)[\"']?\s*[:=]\s*$")
_MAIL = re.compile(r"[\w.+-]+@[\w-]+(?:\.[\w-]+)+")
_LOGIN = re.compile(r"(?P<scheme>[a-z][a-z0-9+.-]*://)[^\s/@]+@", re.IGNORECASE)
_SHORTEST = 4  # letters of a known secret that is looked for
_LARGEST = 300_000  # letters of a file: its end


def mask(text: str, secrets: Iterable[str] = ()) -> str:
    """A text without secrets.

    Args:
        text: of a file.
        secrets: that are known, wherever they stand.
    """
    for secret in sorted({each.strip() for each in secrets if len(each.strip()) >= _SHORTEST}, key=len, reverse=True):
        text = text.replace(secret, _HIDDEN)
    text = _LOGIN.sub(rf"\g<scheme>{_HIDDEN}@", text)
    text = _MAIL.sub(_HIDDEN, text)
    return _KEYS.sub(_masked, text)


def _masked(found: re.Match[str]) -> str:
    if _KEPT.search(found["key"]) or found["value"] in ("''", '""', "[]"):
        return found[0]
    return f"{found['key']}{_HIDDEN}"


def report_zip(texts: Mapping[str, str], secrets: Iterable[str]) -> bytes:
    """The zip file.

    Args:
        texts: contents by file name.
        secrets: that are known: passwords, keys, names of people.
    """
    known = list(secrets)
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        listed = "".join(f"{name}\n" for name in sorted(texts))
        archive.writestr("README.txt", f"{_README}\n{listed}")
        for name, text in sorted(texts.items()):
            archive.writestr(name, mask(text[-_LARGEST:], known))
    return target.getvalue()


def read_secrets(folder: Path) -> list[str]:
    """The lines of all files in a folder of secrets."""
    if not folder.is_dir():
        return []
    found: list[str] = []
    for path in folder.iterdir():
        if path.is_file():
            found += path.read_text("utf-8", "replace").splitlines()
    return found
