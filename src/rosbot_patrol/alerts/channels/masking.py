"""Masks for secrets in other programs' words: a server may repeat in its answer what it was sent.

Of a web address the path and the query are secrets: whoever knows them can send to it.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterable
from urllib.parse import quote, unquote, urlsplit

MASK = "..."
_SHORTEST = 4  # letters of a part that counts by itself; shorter ones only within their whole


def masked_url(url: str) -> str:
    """Scheme, host and port of a web address."""
    parts = urlsplit(url)
    host = f"[{parts.hostname}]" if ":" in (parts.hostname or "") else parts.hostname
    return f"{parts.scheme}://{host}:{parts.port or (443 if parts.scheme == 'https' else 80)}/{MASK}"


class Mask:
    """Takes secrets out of texts, however they are quoted there.

    Args:
        secrets: each of them; empty ones are left out.
    """

    def __init__(self, secrets: Iterable[str]) -> None:
        forms = {form for secret in secrets if secret for form in _forms(secret)}
        longest_first = sorted(forms, key=lambda form: (-len(form), form))
        self.longest = max(map(len, forms), default=0)
        self._found = re.compile("|".join(map(re.escape, longest_first)), re.IGNORECASE) if forms else None

    def __call__(self, text: str) -> str:
        """The text with `...` in place of secrets."""
        return self._found.sub(MASK, text) if self._found else text


def url_secrets(url: str) -> list[str]:
    """What of a web address may not be seen: path and query, and the parts of which they are made."""
    parts = urlsplit(url)
    whole = [parts.path, parts.query, f"{parts.path}?{parts.query}" if parts.query else ""]
    pieces = re.split(r"[/?&=;+]", f"{parts.path}/{parts.query}")
    return [text for text in whole if len(text) > 1] + [piece for piece in pieces if len(piece) >= _SHORTEST]


def _forms(secret: str) -> Iterable[str]:
    plain = unquote(secret)
    for text in {secret, plain}:
        yield text
        yield html.escape(text)
        yield quote(text, safe="/")
        yield quote(text, safe="")
        yield text.replace("/", "\\/")  # in JSON
