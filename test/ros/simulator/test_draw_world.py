"""draw_world: a file comes out, or a sentence."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

pytest.importorskip("rospkg", reason="needs ROS: source the workspace first")

import numpy as np
from PIL import Image

from rosbot_patrol.ros.simulator.draw_world import main

ROOT = Path(__file__).resolve().parents[3]


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    monkeypatch.setattr(sys, "argv", ["draw_world", *arguments, "__name:=draw_world"])
    main()


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_a_picture_of_the_flat_with_rooms_and_sensors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, suffix: str
) -> None:
    out = tmp_path / f"flat.{suffix}"
    rooms, sensors = ROOT / "params" / "flat_room_points.yaml", ROOT / "config" / "flat_sensors.yaml"
    files = (str(ROOT / "worlds" / "flat.world"), str(out), "--rooms", str(rooms), "--sensors", str(sensors))
    run(monkeypatch, *files, "--width", "400")
    image = Image.open(out).convert("RGB")
    assert image.width == 400
    assert f"{out}: 400 x {image.height} pixels" in capsys.readouterr().out
    assert len(np.unique(np.asarray(image).reshape(-1, 3), axis=0)) > 30


def test_a_world_with_missing_files_is_drawn_without_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    box = "<collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision>"
    inside = f"<model name='m'><link name='l'>{box}</link></model><include><uri>model://nowhere</uri></include>"
    (tmp_path / "a.world").write_text(f"<sdf version='1.6'><world name='w'>{inside}</world></sdf>")
    run(monkeypatch, str(tmp_path / "a.world"), str(tmp_path / "a.png"), "--width", "64")
    assert (tmp_path / "a.png").is_file()
    assert "'model://nowhere' is missing" in caplog.text
    assert "a.world: 1 file cannot be used: 1 model left out" in caplog.text


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("/none.world", "a.png"), "draw_world: /none.world: cannot be read"),
        ((str(ROOT / "worlds" / "flat.world"), "a.png", "--width", "3"), "--width 3: expected 16 to 8192 pixels"),
        ((str(ROOT / "worlds" / "flat.world"), "a.nothing", "--width", "64"), "unknown file extension"),
        ((str(ROOT / "worlds" / "flat.world"), "a.png", "--rooms", "/none.yaml"), "/none.yaml"),
    ],
)
def test_what_is_wrong_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, match=sentence):
        run(monkeypatch, *arguments)
    assert not list(tmp_path.iterdir())
