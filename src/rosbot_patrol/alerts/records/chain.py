"""A SHA-256 chain: each link names the digest of its content and the hash of the link before it.

Whoever changes, removes or reorders something afterwards breaks the chain at that place. It holds no secret: somebody
who can write the files can make the whole chain anew, so that a hash which left the robot (mails and reports carry
the record's) is what it is held against.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

START = "0" * 64  # stands for the link before the first one

BEGUN, RECORD, AMENDMENT, REMOVAL = "begun", "record", "amendment", "removal"


@dataclass(frozen=True, kw_only=True)
class Link:
    """One entry of the chain.

    Attributes:
        n: counts from 1, without gaps.
        kind: BEGUN (the chain), RECORD (an incident was closed), AMENDMENT (to a closed one), REMOVAL (by
            retention: the record's and the amendments' bodies are gone, their digests stay).
        incident: its id, "" if the link is about none.
        wall: when, seconds since 1970.
        body: canonical JSON, None if it was removed.
        digest: SHA-256 of the body, in hex.
        previous: hash of the link before.
        hash: of this link, see `link_hash`.
    """

    n: int
    kind: str
    incident: str
    wall: float
    body: str | None
    digest: str
    previous: str
    hash: str


def canonical(tree: Mapping[str, Any]) -> str:
    """The one JSON text of a tree: sorted keys, no spaces; NaN and infinity become null, lone surrogates '?'."""
    return json.dumps(_clean(tree), sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def digest(text: str) -> str:
    """SHA-256 of a text's UTF-8, in hex."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def link_hash(n: int, kind: str, incident: str, wall: float, *, body_digest: str, previous: str) -> str:
    """The hash of a link: over everything in it but the body, which its digest stands for."""
    head = {"n": n, "kind": kind, "incident": incident, "wall": wall, "digest": body_digest, "previous": previous}
    return digest(canonical(head))


def make_link(before: tuple[int, str], kind: str, incident: str, wall: float, body: str) -> Link:
    """The link after one with this number and hash; (0, START) before the first."""
    n, previous, body_digest = before[0] + 1, before[1], digest(body)
    own = link_hash(n, kind, incident, wall, body_digest=body_digest, previous=previous)
    return Link(
        n=n, kind=kind, incident=incident, wall=wall, body=body, digest=body_digest, previous=previous, hash=own
    )


def link_problem(link: Link, before: tuple[int, str]) -> str:
    """What does not fit in a link after one with this number and hash; "" if everything does."""
    if link.n != before[0] + 1:
        gone = link.n - before[0] - 1
        return f"{gone} link{'s are' if gone > 1 else ' is'} missing before it"
    if link.previous != before[1]:
        return "it does not follow the link before it: one of the two was changed, removed or moved"
    if link.hash != link_hash(
        link.n, link.kind, link.incident, link.wall, body_digest=link.digest, previous=link.previous
    ):
        return "its hash is not that of what it says: it was changed"
    if link.body is not None and digest(link.body) != link.digest:
        return "its record is not the one that was hashed: it was changed"
    return ""


def _clean(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {_clean(str(key)): _clean(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_clean(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode("utf-8")
    return value
