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
        ({"encoding": "nv21"}, "'nv21' is not known here, expected one of mono8"),
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


@pytest.mark.parametrize("encoding", ["rgb16", "bgr16", "rgba16", "bgra16"])
def test_colours_of_16_bits(encoding):
    order = {"r": 0, "b": 2}[encoding[0]]
    pixels = np.full((2, 3, ENCODINGS[encoding].channels), 9, dtype=np.uint16)
    pixels[:, :, order], pixels[:, :, 1], pixels[:, :, 2 - order] = 200 * 257, 100 * 257, 0
    assert Picture(pixels, encoding).eight_bits().encoding == encoding.replace("16", "8")
    assert Picture(pixels, encoding).to("rgb8").pixels[1, 2].tolist() == [200, 100, 0]


def make_mosaic(pattern, colour, dtype=np.uint8):
    """What a chip with that pattern sees of one even colour (red, green, blue)."""
    tile = np.array(["rgb".index(letter) for letter in pattern]).reshape(2, 2)
    return np.tile(np.array(colour, dtype=dtype)[tile], (4, 5))[:, :, None]


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_mosaics(pattern):
    colour = [200, 90, 10]
    seen = Picture(make_mosaic(pattern, colour), f"bayer_{pattern}8")
    assert (seen.to("rgb8").pixels == colour).all()
    assert (seen.to("bgr8").pixels == colour[::-1]).all()
    deep = Picture(make_mosaic(pattern, [c * 257 for c in colour], np.uint16), f"bayer_{pattern}16")
    assert (deep.to("rgb8").pixels == colour).all()


@pytest.mark.parametrize(("encoding", "pair"), [("yuv422", [90, 82, 240, 82]), ("yuv422_yuy2", [82, 90, 82, 240])])
def test_yuv(encoding, pair):
    # BT.601: y 82, u 90, v 240 is red
    picture = Picture(np.tile(np.array(pair, np.uint8), (4, 6)).reshape(4, 12, 2), encoding)
    red, green, blue = picture.to("rgb8").pixels[2, 5].tolist()
    assert red > 250
    assert max(green, blue) < 6


def test_raw_pictures_too_small_for_their_pattern():
    with pytest.raises(ImageError, match="3x4 bayer_rggb8 is too small for its colours, expected 4x4"):
        Picture(np.zeros((4, 3, 1), np.uint8), "bayer_rggb8").to("rgb8")
    with pytest.raises(ImageError, match="5x4 yuv422 has half a pair"):
        Picture(np.zeros((4, 5, 2), np.uint8), "yuv422").to("rgb8")
