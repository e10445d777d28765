import hashlib
from pathlib import Path

import pytest

from rosbot_patrol.detection.catalogue import CATALOGUE, REAL_CAMERA, NetworkFile, check_file
from rosbot_patrol.errors import DetectorError
from rosbot_patrol.yaml_files import read_mapping

DARKNET = Path(__file__).parents[3] / "drop_in" / "darknet_ros"


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_entry_has_its_settings(name):
    network = CATALOGUE[name]
    model = read_mapping(DARKNET / "config" / f"{name}.yaml", keys="of the network")["yolo_model"]
    assert [model["config_file"]["name"], model["weight_file"]["name"]] == [f"{name}.cfg", network.files[-1].file]
    assert all(url.startswith("https://") and url.endswith(file.file) for file in network.files for url in file.urls)
    assert not network.files[-1].is_cfg
    assert network.has_cfg == (name == REAL_CAMERA)


def test_sums_have_the_length_of_their_algorithm():
    sums = [item for network in CATALOGUE.values() for file in network.files for item in file.sums.items()]
    assert all(len(value) == 2 * hashlib.new(name).digest_size for name, value in sums)
    assert all(file.sha256 for file in CATALOGUE[REAL_CAMERA].files)


def test_a_file_is_checked(tmp_path):
    path, data = tmp_path / "a.weights", b"twelve bytes"
    good = NetworkFile(file="a.weights", size=12, urls=("https://a",), sha256=hashlib.sha256(data).hexdigest())
    with pytest.raises(DetectorError, match=r"a\.weights is not there"):
        check_file(path, good)
    path.write_bytes(data)
    check_file(path, good)
    path.write_bytes(data[:-1])
    with pytest.raises(DetectorError, match=r"a\.weights is damaged: it has 11 bytes, expected 12"):
        check_file(path, good)
    path.write_bytes(b"other  bytes")
    with pytest.raises(DetectorError, match=rf"a\.weights is damaged: it has the sha256 \w+, expected {good.sha256}"):
        check_file(path, good)
    with pytest.raises(DetectorError, match="cannot be read: Not a directory"):
        check_file(path / "b", good)
