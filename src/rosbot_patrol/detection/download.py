"""Download of one file over HTTP: resumed after a break; at the end complete or absent."""

from __future__ import annotations

import http.client
import os
import re
import shutil
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

from rosbot_patrol.detection.catalogue import check_sums
from rosbot_patrol.errors import DetectorError

TIMEOUT = 20.0
CHUNK = 1 << 16
MOST_CUTS = 20
"""So often a connection may break, if each time something came."""


def fetch(
    urls: Sequence[str],
    target: Path,
    *,
    size: int,
    sums: Mapping[str, str] | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> None:
    """Download a file; a partial download stays in TARGET.part and is resumed the next time.

    Args:
        urls: http or https addresses of the same file, tried in this order.
        target: path of the file; its folder is created.
        size: expected size [bytes].
        sums: expected checksums of its content by the name of their algorithm, such as sha256.
        progress: called now and then with the number of bytes.

    Raises:
        DetectorError: no address gives it; says why each of them does not.
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
    problems = []
    for url in urls:
        try:
            _fetch_checked(url, part, size, sums or {}, progress)
        except DetectorError as err:
            problems.append(str(err))
        else:
            os.replace(part, target)
            return
    raise DetectorError("; ".join(problems))


def _fetch_checked(url: str, part: Path, size: int, sums: Mapping[str, str], progress: Callable[[int], None]) -> None:
    _fetch_all(url, part, size, progress)
    problem = check_sums(part, sums)
    if problem:
        part.unlink()
        raise DetectorError(f"what {url} gave {problem}; it was thrown away")


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
