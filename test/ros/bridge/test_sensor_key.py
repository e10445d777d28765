"""`rosrun rosbot_patrol sensor_key` and `esp_client --key-file`, as functions."""

import re

import pytest

from rosbot_patrol.ros.bridge import esp_client_node, sensor_key_node
from rosbot_patrol.rosserial.protocol.keys import read_keys


def run(module, monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["program", *arguments, "__name:=x"])
    module.main()


def test_key_for_bridge_and_firmware(monkeypatch, capsys, tmp_path):
    run(sensor_key_node, monkeypatch, "2")
    said = capsys.readouterr().out
    (key,) = re.findall(r'^  2: "([0-9a-f]{64})"$', said, re.MULTILINE)
    assert f'#define SENSOR_ID 2\n#define SENSOR_KEY "{key}"' in said
    path = tmp_path / "keys.yaml"
    run(sensor_key_node, monkeypatch, "3", "--file", str(path))
    said = capsys.readouterr().out
    assert read_keys(path)[3].hex() in said
    with pytest.raises(SystemExit, match=r"sensor_key: .*keys/3: is there already; --replace"):
        run(sensor_key_node, monkeypatch, "3", "--file", str(path))
    with pytest.raises(SystemExit):
        run(sensor_key_node, monkeypatch, "256")
    assert "256: expected a sensor id, 0 to 255" in capsys.readouterr().err


def test_esp_client_says_what_is_wrong_with_its_key_file(monkeypatch, capsys, tmp_path):
    with pytest.raises(SystemExit, match=r"esp_client: .*none\.yaml: cannot be read: No such file"):
        run(esp_client_node, monkeypatch, "--id", "2", "--key-file", str(tmp_path / "none.yaml"))
    with pytest.raises(SystemExit):
        run(esp_client_node, monkeypatch, "--insist")
    assert "--insist needs a --key-file" in capsys.readouterr().err
