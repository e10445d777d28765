import functools
import http.server
import threading

import numpy as np
import pytest

pytest.importorskip("rospkg", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.detection.darknet.cfg import parse_cfg
from rosbot_patrol.detection.darknet.random_weights import random_weights
from rosbot_patrol.detection.darknet.weights import format_weights
from rosbot_patrol.detection.weights_catalogue import CATALOGUE, WeightsFile
from rosbot_patrol.ros.detector.download_weights import Bar, get, run

CFG = "[net]\nwidth=32\nheight=32\n[convolutional]\nfilters=6\n[region]\nanchors=1,1\nclasses=1\nnum=1\n"


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture
def site(tmp_path):
    """A server of tmp_path/site, where small.weights lies; its address, and what is known of the file."""
    spec = parse_cfg(CFG)
    data = format_weights(spec, random_weights(spec, np.random.default_rng(0)))
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "small.weights").write_bytes(data)
    (tmp_path / "small.cfg").write_text(CFG)
    handler = functools.partial(Quiet, directory=str(tmp_path / "site"))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    url = f"http://127.0.0.1:{server.server_address[1]}/small.weights"
    yield WeightsFile(name="small", size=len(data), url=url)
    server.shutdown()
    server.server_close()


def test_fetched_checked_and_said_how_to_start(site, tmp_path, capsys):
    assert get(site, tmp_path / "weights", tmp_path / "small.cfg", site.url) == 0
    said = capsys.readouterr().out
    assert "100 %" in said
    assert "it fits small.cfg. Start with: roslaunch rosbot_patrol rosbot_patrol.launch network:=small" in said
    assert get(site, tmp_path / "weights", tmp_path / "small.cfg", site.url) == 0
    assert "small.weights is there already" in capsys.readouterr().out


def test_a_file_of_another_network_that_lies_there(site, tmp_path, capsys):
    (tmp_path / "small.weights").write_bytes((tmp_path / "site" / "small.weights").read_bytes()[:99])
    assert get(site, tmp_path, tmp_path / "small.cfg", site.url) == 1
    said = capsys.readouterr().err
    assert f"small.weights is cut short: it has 99 bytes, {tmp_path}/small.cfg needs {site.size}" in said


def test_without_a_way_there_it_says_what_to_put_where(tmp_path, capsys):
    known = CATALOGUE["yolov3-tiny"]
    assert run(["yolov3-tiny", "--folder", str(tmp_path), "--url", "http://127.0.0.1:1/a"]) == 1
    said = capsys.readouterr().err
    assert "http://127.0.0.1:1/a cannot be reached: [Errno 111] Connection refused" in said
    assert f"fetch yolov3-tiny.weights (35,434,956 bytes, sha256 {known.sha256}) elsewhere" in said
    assert f"put it into {tmp_path}; its authors offer it at {known.url}" in said


def test_names(capsys):
    assert run([]) == 0
    said = capsys.readouterr().out
    assert all(word in said for word in ("yolov2-tiny-voc", "44,948,600 bytes", "https://"))
    assert run(["yolov2-tyni"]) == 1
    assert "'yolov2-tyni' is not known here, did you mean 'yolov2-tiny'?" in capsys.readouterr().err


def test_a_folder_that_takes_no_file(site, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert get(site, tmp_path / "file", tmp_path / "small.cfg", site.url) == 1
    assert f"{tmp_path}/file does not take the file" in capsys.readouterr().err


def test_bar(capsys, monkeypatch):
    bar = Bar(1_000_000)
    monkeypatch.setattr(bar, "_terminal", True)
    for have in (0, 400_000, 1_000_000):
        bar(have)
    said = capsys.readouterr().err
    assert "[..............................]   0 %" in said
    assert "[##############################] 100 %  1.0 MB" in said
    assert said.endswith("\n")
