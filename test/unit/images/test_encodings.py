import numpy as np
import pytest

from rosbot_patrol.errors import ImageError
from rosbot_patrol.images.encodings import ENCODINGS, Picture, pack, unpack


def make_pixels(encoding, *, width=5, height=3):
    known = ENCODINGS[encoding]
    values = np.random.default_rng(0).integers(0, 255, (height, width, known.channels))
    return values.astype(known.dtype)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_round_trip(encoding):
    picture = Picture(make_pixels(encoding), encoding)
    data, step = pack(picture)
    back = unpack(data, encoding, width=5, height=3, step=step)
    np.testing.assert_array_equal(back.pixels, picture.pixels)
    assert back.encoding == encoding


def test_gaps_at_the_end_of_rows_and_big_endian():
    values = np.arange(6, dtype=">u2").reshape(2, 3)
    data = b"".join(row.tobytes() + b"\xff\xff" for row in values)
    picture = unpack(data, "mono16", width=3, height=2, step=8, big_endian=True)
    assert picture.pixels[:, :, 0].tolist() == [[0, 1, 2], [3, 4, 5]]
    assert picture.pixels.dtype == np.uint16


def test_colours():
    red = Picture(np.array([[[200, 0, 10]]], np.uint8), "rgb8")
    assert red.to("bgr8").pixels.tolist() == [[[10, 0, 200]]]
    assert red.to("rgb8") is red
    assert red.to("mono8").pixels.tolist() == [[[61]]]
    alpha = Picture(np.array([[[1, 2, 3, 9]]], np.uint8), "bgra8")
    assert alpha.to("rgb8").pixels.tolist() == [[[3, 2, 1]]]
    assert alpha.to("bgr8").pixels.tolist() == [[[1, 2, 3]]]
    assert Picture(np.array([[[5]]], np.uint8), "mono8").to("rgb8").pixels.tolist() == [[[5, 5, 5]]]


def test_16_bits_are_scaled():
    deep = Picture(np.array([[[0], [257], [65535]]], np.uint16), "mono16")
    assert deep.eight_bits().pixels.ravel().tolist() == [0, 1, 255]
    assert deep.eight_bits().encoding == "mono8"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"encoding": "yuv422"}, "'yuv422' is not known here, expected one of mono8"),
        ({"width": 0}, "0x2 pixels is empty"),
        ({"step": 3}, r"3x2 rgb8 with rows of 3 bytes needs 18 bytes"),
        ({"height": 3}, "needs 27 bytes, it has 18"),
    ],
)
def test_messages_that_make_no_sense(change, message):
    fields = {"encoding": "rgb8", "width": 3, "height": 2, "step": 9} | change
    with pytest.raises(ImageError, match=message):
        unpack(bytes(18), fields.pop("encoding"), **fields)


def test_depth_has_no_colours():
    with pytest.raises(ImageError, match="16UC1 has no colours"):
        Picture(np.zeros((1, 1, 1), np.uint16), "16UC1").to("rgb8")
    with pytest.raises(ImageError, match="not converted to rgba8"):
        Picture(np.zeros((1, 1, 3), np.uint8), "rgb8").to("rgba8")
