"""The seconds about a sighting as a video (H.264 in MP4, by ffmpeg), which phones and browsers play."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from rosbot_patrol.errors import AlertError

CLIP = "clip.mp4"
_FEWEST = 5  # pictures that make a clip
_TIMEOUT = 60.0  # [s]; 125 pictures of 640 x 480 take 1 s
_SHOWN = 300  # letters of ffmpeg's words


def encode_clip(pictures: Sequence[tuple[float, bytes]], program: str = "ffmpeg") -> bytes | None:
    """A video of pictures; None where they are too few for one.

    The pictures follow each other at their mean rate.

    Args:
        pictures: stamp [s] and JPEG of each, the oldest first.
        program: path of ffmpeg.

    Raises:
        AlertError: ffmpeg is not installed, or did not do it.
    """
    if len(pictures) < _FEWEST or pictures[-1][0] <= pictures[0][0]:
        return None
    rate = (len(pictures) - 1) / (pictures[-1][0] - pictures[0][0])
    with tempfile.TemporaryDirectory(prefix="clip-") as folder:
        target = Path(folder) / CLIP
        command = ["nice", "-n", "10", program, "-nostdin", "-loglevel", "error", "-f", "image2pipe"]
        command += ["-c:v", "mjpeg", "-framerate", f"{rate:.3f}", "-i", "pipe:0", "-an"]
        command += ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"]
        command += ["-c:v", "libx264", "-preset", "veryfast", "-crf", "26", "-threads", "1"]
        command += ["-movflags", "+faststart", str(target)]
        data = b"".join(jpeg for _, jpeg in pictures)
        try:
            done = subprocess.run(command, input=data, capture_output=True, timeout=_TIMEOUT, check=False)
        except (OSError, subprocess.TimeoutExpired) as err:
            raise AlertError(f"no clip was made: {err}") from err
        if done.returncode == 127 or (done.returncode != 0 and b"No such file" in done.stderr[:200]):
            raise AlertError(f"no clip was made: there is no {program}; install the package ffmpeg")
        if done.returncode != 0 or not target.exists():
            said = " ".join(done.stderr.decode("utf-8", "replace").split())[:_SHOWN] or "it said nothing"
            raise AlertError(f"no clip was made: ffmpeg ended with {done.returncode}: {said}")
        return target.read_bytes()
