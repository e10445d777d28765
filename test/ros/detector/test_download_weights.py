import dataclasses
import functools
import hashlib
import http.server
import threading
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rospkg", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.detection.catalogue import CATALOGUE, REAL_CAMERA, NetworkFile, PublishedNetwork
from rosbot_patrol.detection.darknet.cfg import parse_cfg
from rosbot_patrol.detection.darknet.random_weights import random_weights
from rosbot_patrol.detection.darknet.weights import format_weights
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
    yield PublishedNetwork(name="small", files=(NetworkFile(file="small.weights", size=len(data), urls=(url,)),))
    server.shutdown()
    server.server_close()


def test_fetched_checked_and_said_how_to_start(site, tmp_path, capsys):
    assert get(site, tmp_path / "weights", tmp_path) == 0
    said = capsys.readouterr().out
    assert "100 %" in said
    assert "it fits small.cfg. Start with: roslaunch rosbot_patrol rosbot_patrol.launch network:=small" in said
    assert get(site, tmp_path / "weights", tmp_path) == 0
    assert "small.weights is there already" in capsys.readouterr().out


def test_a_file_of_another_network_that_lies_there(site, tmp_path, capsys):
    (tmp_path / "small.weights").write_bytes((tmp_path / "site" / "small.weights").read_bytes()[:99])
    assert get(site, tmp_path, tmp_path) == 1
    said = capsys.readouterr().err
    assert f"small.weights is cut short: it has 99 bytes, {tmp_path}/small.cfg needs {site.size}" in said


def test_without_a_way_there_it_says_what_to_put_where(tmp_path, capsys):
    known = CATALOGUE["yolov3-tiny"].files[0]
    assert run(["yolov3-tiny", "--folder", str(tmp_path), "--url", "http://127.0.0.1:1/a"]) == 1
    said = capsys.readouterr().err
    assert "http://127.0.0.1:1/a cannot be reached: [Errno 111] Connection refused" in said
    assert f"fetch yolov3-tiny.weights (35,434,956 bytes, sha256 {known.sha256}, md5 {known.md5}) elsewhere" in said
    assert f"put it into {tmp_path}; its authors offer it at {known.urls[0]}" in said


def test_names(capsys):
    assert run([]) == 0
    said = capsys.readouterr().out
    assert all(word in said for word in ("yolov2-tiny-voc", "44,948,600 bytes", "https://"))
    assert run(["yolov2-tyni"]) == 1
    assert "'yolov2-tyni' is not known here, did you mean 'yolov2-tiny'?" in capsys.readouterr().err


def test_a_folder_that_takes_no_file(site, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert get(site, tmp_path / "file", tmp_path) == 1
    assert f"{tmp_path}/file does not take the file" in capsys.readouterr().err


@pytest.fixture
def whole(site, tmp_path):
    """The same network with a cfg file and sums, as yolo-fastest-1.1-xl has them; and the folders."""
    (tmp_path / "site" / "small.cfg").write_text(CFG)
    folder = site.files[0].urls[0].removesuffix("small.weights")
    files = [
        NetworkFile(
            file=name,
            size=(tmp_path / "site" / name).stat().st_size,
            urls=(folder + name,),
            sha256=hashlib.sha256((tmp_path / "site" / name).read_bytes()).hexdigest(),
        )
        for name in ("small.cfg", "small.weights")
    ]
    return PublishedNetwork(name="small", files=tuple(files)), tmp_path / "weights", tmp_path / "cfg"


def test_cfg_and_weights(whole, capsys):
    network, weights, cfgs = whole
    assert get(*whole) == 0
    assert (cfgs / "small.cfg").read_text() == CFG
    assert "it fits small.cfg" in capsys.readouterr().out
    assert get(*whole) == 0
    said = capsys.readouterr().out
    assert (said.count("is there already"), said.count("fetching")) == (2, 0)
    assert network.size == sum(path.stat().st_size for path in (cfgs / "small.cfg", weights / "small.weights"))


@pytest.mark.parametrize("name", ["small.cfg", "small.weights"])
def test_a_damaged_file_is_fetched_again(whole, capsys, name):
    _, weights, cfgs = whole
    assert get(*whole) == 0
    path = (cfgs if name.endswith("cfg") else weights) / name
    good = path.read_bytes()
    for bad, problem in ((good[:-9], f"it has {len(good) - 9} bytes"), (good[:-1] + b"!", "it has the sha256")):
        path.write_bytes(bad)
        assert get(*whole) == 0
        assert f"{path} is damaged: {problem}" in capsys.readouterr().out
        assert path.read_bytes() == good


def test_a_server_that_lacks_one_of_the_files(whole, tmp_path, capsys):
    (tmp_path / "site" / "small.weights").unlink()
    assert get(*whole) == 1
    said = capsys.readouterr().err
    assert "small.weights answers 404" in said
    assert "fetch small.weights (" in said
    assert not (tmp_path / "weights" / "small.weights").exists()


def test_another_folder_of_the_same_files(whole, tmp_path, capsys):
    network, weights, cfgs = whole
    elsewhere = [dataclasses.replace(file, urls=("http://127.0.0.1:1/x",)) for file in network.files]
    gone = PublishedNetwork(name="small", files=tuple(elsewhere))
    assert get(gone, weights, cfgs) == 1
    assert get(gone, weights, cfgs, network.files[0].urls[0].removesuffix("small.cfg")) == 0
    assert "it fits small.cfg" in capsys.readouterr().out


PEOPLE = Path(__file__).parents[4] / "shared" / "people" / "networks"


@pytest.mark.skipif(not PEOPLE.is_dir(), reason=f"{PEOPLE} with yolo-fastest-1.1-xl is not here")
def test_the_network_for_a_real_camera(tmp_path, capsys):
    handler = functools.partial(Quiet, directory=str(PEOPLE))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        url = f"http://127.0.0.1:{server.server_address[1]}/"
        assert run([REAL_CAMERA, "--folder", str(tmp_path), "--url", url]) == 0
        server.shutdown()
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{REAL_CAMERA}.cfg", f"{REAL_CAMERA}.weights"]
    assert f"Start with: roslaunch rosbot_patrol rosbot_patrol.launch network:={REAL_CAMERA}" in capsys.readouterr().out


def test_bar(capsys, monkeypatch):
    bar = Bar(1_000_000)
    monkeypatch.setattr(bar, "_terminal", True)
    for have in (0, 400_000, 1_000_000):
        bar(have)
    said = capsys.readouterr().err
    assert "[..............................]   0 %" in said
    assert "[##############################] 100 %  1.0 MB" in said
    assert said.endswith("\n")
