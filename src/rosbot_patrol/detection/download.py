"""Download of one large file over HTTP: resumed after a break; at the end complete or absent."""

from __future__ import annotations

import hashlib
import http.client
import os
import re
import shutil
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from rosbot_patrol.errors import DetectorError

TIMEOUT = 20.0
CHUNK = 1 << 16
MOST_CUTS = 20
"""So often a connection may break, if each time something came."""


def fetch(
    url: str, target: Path, *, size: int, sha256: str = "", progress: Callable[[int], None] = lambda _: None
) -> None:
    """Download a file; a partial download stays in TARGET.part and is resumed the next time.

    Args:
        url: http or https.
        target: path of the file; its folder is created.
        size: expected size [bytes].
        sha256: expected sum of its content, "" for any.
        progress: called now and then with the number of bytes.

    Raises:
        DetectorError: it is not available, or is another file; says why.
        OSError: the disk does not take it.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(target.name + ".part")
    have = part.stat().st_size if part.exists() else 0
    if have > size:
        part.unlink()
        have = 0
    free = shutil.disk_usage(target.parent).free
    if free < size - have:
        raise DetectorError(f"{target.parent} has {free:,} bytes free, {target.name} needs {size - have:,}")
    _fetch_all(url, part, size, progress)
    if sha256:
        found = _sum(part)
        if found != sha256:
            part.unlink()
            raise DetectorError(f"what {url} gave has the sha256 {found}, expected {sha256}; it was thrown away")
    os.replace(part, target)


def _fetch_all(url: str, part: Path, size: int, progress: Callable[[int], None]) -> None:
    for _ in range(MOST_CUTS):
        before = part.stat().st_size if part.exists() else 0
        if before == size:
            return
        cut = _fetch_some(url, part, before, size, progress)
        have = part.stat().st_size
        if have == size:
            return
        if have <= before:
            raise DetectorError(f"{url} gives no more than {have:,} of {size:,} bytes ({cut})")
    raise DetectorError(f"{url}: the connection broke {MOST_CUTS} times; what came is kept, try again")


def _fetch_some(url: str, part: Path, have: int, size: int, progress: Callable[[int], None]) -> str:
    """Download until the connection ends; returns the reason."""
    request = urllib.request.Request(url, headers={"User-Agent": "rosbot_patrol", "Accept-Encoding": "identity"})
    if have:
        request.add_header("Range", f"bytes={have}-")
    try:
        with urllib.request.urlopen(request, timeout=TIMEOUT) as answer:
            start = _check(url, answer, have, size)
            with part.open("r+b" if part.exists() else "wb") as file:
                file.seek(start)
                file.truncate()
                return _copy(answer, file, start, size, url, progress=progress)
    except urllib.error.HTTPError as err:
        if err.code == http.client.REQUESTED_RANGE_NOT_SATISFIABLE and have:
            part.unlink()  # the file has changed: start again
            return _fetch_some(url, part, 0, size, progress)
        raise DetectorError(f"{url} answers {err.code} {err.reason}") from err
    except urllib.error.URLError as err:
        raise DetectorError(f"{url} cannot be reached: {err.reason}") from err
    except (http.client.HTTPException, OSError) as err:
        if isinstance(err, OSError) and err.filename is not None:
            raise  # an error of the disk
        if not part.exists():
            raise DetectorError(f"{url} broke off: {err or type(err).__name__}") from err
        return str(err) or type(err).__name__


def _check(url: str, answer: http.client.HTTPResponse, have: int, size: int) -> int:
    """Offset in the file at which the response begins; DetectorError if it is another file."""
    start, offered = 0, answer.headers.get("Content-Length")
    total = int(offered) if offered and offered.isdigit() else None
    if have and answer.status == http.client.PARTIAL_CONTENT:
        found = re.fullmatch(r"bytes (\d+)-\d+/(\d+|\*)", answer.headers.get("Content-Range", ""))
        if found is None or int(found[1]) > have:
            raise DetectorError(f"{url} answers a question for the rest of the file with something else")
        start, total = int(found[1]), int(found[2]) if found[2] != "*" else None
    if total is not None and total != size:
        raise DetectorError(f"{url} offers {total:,} bytes, expected {size:,}: it is another file")
    return start


def _copy(
    answer: http.client.HTTPResponse, file: BinaryIO, have: int, size: int, url: str, *, progress: Callable[[int], None]
) -> str:
    while chunk := answer.read(CHUNK):
        have += len(chunk)
        if have > size:
            file.seek(0)
            file.truncate()
            raise DetectorError(f"{url} gives more than the {size:,} bytes expected: it is another file")
        file.write(chunk)
        progress(have)
    return "the connection was closed"


def _sum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
