import hashlib
import http.server
import os
import threading
from types import SimpleNamespace

import pytest

from rosbot_patrol.detection import download
from rosbot_patrol.detection.download import fetch
from rosbot_patrol.errors import DetectorError

DATA = os.urandom(300_000)
SUM, MD5 = hashlib.sha256(DATA).hexdigest(), hashlib.md5(DATA).hexdigest()


class Server(http.server.ThreadingHTTPServer):
    """One file; `cut_after` bytes an answer at most, `ranges` as asked or not at all."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        self.data, self.cut_after, self.ranges, self.lengths, self.status = DATA, None, True, True, 200
        self.asked = []
        threading.Thread(target=self.serve_forever, args=(0.02,), daemon=True).start()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.server_address[1]}/a.weights"


class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        server, wanted = self.server, self.headers.get("Range")
        server.asked.append(wanted)
        if server.status != 200:
            return self.send_error(server.status)
        start = int(wanted[6:-1]) if wanted and server.ranges else 0
        if start >= len(server.data):
            return self.send_error(416)
        body = server.data[start:]
        self.send_response(206 if start else 200)
        if server.lengths:
            self.send_header("Content-Length", str(len(body)))
        if start:
            self.send_header("Content-Range", f"bytes {start}-{len(server.data) - 1}/{len(server.data)}")
        self.end_headers()
        self.wfile.write(body[: server.cut_after])
        return None

    def log_message(self, *_):
        pass


@pytest.fixture
def server():
    found = Server()
    yield found
    found.shutdown()
    found.server_close()


def get(server, target, **change):
    fetch([server.url], target, **{"size": len(DATA), "sums": {"sha256": SUM}} | change)


def leftovers(target):
    return sorted(path.name for path in target.parent.iterdir())


def test_a_whole_file(server, tmp_path):
    told = []
    get(server, tmp_path / "new" / "a.weights", progress=told.append)
    assert (tmp_path / "new" / "a.weights").read_bytes() == DATA
    assert told[-1] == len(DATA)
    assert told == sorted(told)
    assert leftovers(tmp_path / "new" / "a.weights") == ["a.weights"]


def test_a_cut_connection_is_resumed(server, tmp_path):
    server.cut_after = 100_000
    get(server, tmp_path / "a.weights")
    assert (tmp_path / "a.weights").read_bytes() == DATA
    assert server.asked == [None, "bytes=100000-", "bytes=200000-"]


def test_what_came_before_is_gone_on_with(server, tmp_path):
    (tmp_path / "a.weights.part").write_bytes(DATA[:123_456])
    get(server, tmp_path / "a.weights")
    assert (tmp_path / "a.weights").read_bytes() == DATA
    assert server.asked == ["bytes=123456-"]


def test_a_server_without_ranges_begins_again(server, tmp_path):
    server.ranges = False
    (tmp_path / "a.weights.part").write_bytes(b"x" * 1000)
    get(server, tmp_path / "a.weights")
    assert (tmp_path / "a.weights").read_bytes() == DATA


def test_a_server_that_never_gets_further_is_given_up(server, tmp_path):
    server.ranges, server.cut_after = False, 1000
    with pytest.raises(DetectorError, match=r"gives no more than 1,000 of 300,000 bytes"):
        get(server, tmp_path / "a.weights")
    assert leftovers(tmp_path / "a.weights") == ["a.weights.part"]


def test_another_file_is_noticed_before_it_is_fetched(server, tmp_path):
    server.data = DATA + b"more"
    with pytest.raises(DetectorError, match=r"offers 300,004 bytes, expected 300,000: it is another file"):
        get(server, tmp_path / "a.weights")
    (tmp_path / "a.weights.part").write_bytes(DATA[:1000])
    with pytest.raises(DetectorError, match=r"offers 300,004 bytes"):
        get(server, tmp_path / "a.weights")
    server.lengths = False
    (tmp_path / "a.weights.part").unlink()
    with pytest.raises(DetectorError, match=r"gives more than the 300,000 bytes expected"):
        get(server, tmp_path / "a.weights")
    assert not (tmp_path / "a.weights").exists()


def test_a_wrong_sum_is_thrown_away(server, tmp_path):
    with pytest.raises(DetectorError, match=rf"has the sha256 {SUM}, expected 00; it was thrown away"):
        get(server, tmp_path / "a.weights", sums={"sha256": "00"})
    assert leftovers(tmp_path / "a.weights") == []
    with pytest.raises(DetectorError, match=rf"has the md5 {MD5}, expected 00; it was thrown away"):
        get(server, tmp_path / "a.weights", sums={"sha256": SUM, "md5": "00"})
    assert leftovers(tmp_path / "a.weights") == []


def test_a_part_that_is_too_long_is_thrown_away(server, tmp_path):
    (tmp_path / "a.weights.part").write_bytes(bytes(len(DATA) + 1))
    get(server, tmp_path / "a.weights")
    assert server.asked == [None]


def test_no_way_there(server, tmp_path, monkeypatch):
    server.status = 403
    with pytest.raises(DetectorError, match="answers 403 Forbidden"):
        get(server, tmp_path / "a.weights")
    with pytest.raises(DetectorError, match=r"cannot be reached: .*refused"):
        fetch(["http://127.0.0.1:1/a.weights"], tmp_path / "a.weights", size=5)
    monkeypatch.setattr(download.shutil, "disk_usage", lambda _: SimpleNamespace(free=9))
    with pytest.raises(DetectorError, match=r"has 9 bytes free, a.weights needs 300,000"):
        get(server, tmp_path / "a.weights")


@pytest.fixture
def mirror():
    found = Server()
    yield found
    found.shutdown()
    found.server_close()


def test_the_second_address_when_the_first_is_gone(server, mirror, tmp_path):
    urls = ["http://127.0.0.1:1/a.weights", mirror.url]
    fetch(urls, tmp_path / "a.weights", size=len(DATA), sums={"sha256": SUM})
    assert (tmp_path / "a.weights").read_bytes() == DATA
    server.status = 404
    fetch([server.url, mirror.url], tmp_path / "b.weights", size=len(DATA))
    assert (tmp_path / "b.weights").read_bytes() == DATA


def test_the_second_address_when_the_first_gives_another_file(server, mirror, tmp_path):
    server.data = os.urandom(len(DATA))
    fetch([server.url, mirror.url], tmp_path / "a.weights", size=len(DATA), sums={"md5": MD5})
    assert (tmp_path / "a.weights").read_bytes() == DATA
    assert mirror.asked == [None]


def test_the_second_address_goes_on_where_the_first_was_cut(server, mirror, tmp_path):
    server.ranges, server.cut_after = False, 100_000
    fetch([server.url, mirror.url], tmp_path / "a.weights", size=len(DATA), sums={"sha256": SUM})
    assert (tmp_path / "a.weights").read_bytes() == DATA
    assert mirror.asked == ["bytes=100000-"]


def test_each_address_that_fails_is_named(server, mirror, tmp_path):
    server.status, mirror.status = 404, 503
    with pytest.raises(DetectorError, match=r"answers 404 Not Found; .* answers 503 Service Unavailable"):
        fetch([server.url, mirror.url], tmp_path / "a.weights", size=len(DATA))


def test_a_folder_that_cannot_be_written(server, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OSError, match="exists"):
        get(server, tmp_path / "file" / "a.weights")
