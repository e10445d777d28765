"""Programs that need no OpenCV do not import it: it costs 98 MB."""

import subprocess
import sys


def test_drawing_does_not_bring_opencv():
    code = "import sys; from rosbot_patrol.detection import draw; sys.exit('cv2' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_jpegs_there_and_back_do_without_opencv():
    code = """
import sys
import numpy as np
from rosbot_patrol.images.compressed import CompressedParams, compress, decompress
from rosbot_patrol.images.encodings import Picture
for encoding, channels in (("rgb8", 3), ("bgr8", 3), ("rgba8", 4), ("bgra8", 4), ("mono8", 1)):
    text, data = compress(Picture(np.full((8, 8, channels), 90, np.uint8), encoding), CompressedParams())
    assert decompress(text, data).encoding == encoding
sys.exit("cv2" in sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], check=True)
