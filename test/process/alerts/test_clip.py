"""The video of a sighting, by Debian's ffmpeg."""

from __future__ import annotations

import io
import json
import subprocess
from pathlib import Path

import pytest
from PIL import Image

from rosbot_patrol.alerts.pictures.clip import encode_clip
from rosbot_patrol.errors import AlertError


def picture(shade: int, size: tuple[int, int] = (641, 480)) -> bytes:
    out = io.BytesIO()
    Image.new("RGB", size, (shade, 80, 80)).save(out, "JPEG")
    return out.getvalue()


def test_a_clip_is_h264_that_phones_play_and_as_long_as_the_pictures_are_apart(tmp_path: Path) -> None:
    pictures = [(100.0 + 0.2 * i, picture(2 * i)) for i in range(101)]
    data = encode_clip(pictures)
    assert data is not None
    file = tmp_path / "clip.mp4"
    file.write_bytes(data)
    shown = "stream=codec_name,pix_fmt,width,height,nb_frames,duration"
    command = ["ffprobe", "-v", "error", "-show_entries", shown, "-of", "json", str(file)]
    stream = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)["streams"][0]
    assert (stream["codec_name"], stream["pix_fmt"], stream["width"], stream["height"]) == ("h264", "yuv420p", 642, 480)
    assert int(stream["nb_frames"]) == 101
    assert float(stream["duration"]) == pytest.approx(20.2, abs=0.1)
    assert data.index(b"moov") < data.index(b"mdat")  # it plays before all of it has arrived


def test_few_pictures_make_none() -> None:
    assert encode_clip([]) is None
    assert encode_clip([(0.2 * i, picture(i)) for i in range(4)]) is None
    assert encode_clip([(1.0, picture(i)) for i in range(9)]) is None


def test_damaged_pictures_are_an_error_that_says_so() -> None:
    with pytest.raises(AlertError, match="no clip was made: ffmpeg ended with"):
        encode_clip([(0.2 * i, b"no picture") for i in range(9)])


def test_a_machine_without_ffmpeg_is_told_what_to_install() -> None:
    with pytest.raises(AlertError, match="there is no ffmpeg-of-nobody; install the package ffmpeg"):
        encode_clip([(0.2 * i, picture(i)) for i in range(9)], "ffmpeg-of-nobody")
