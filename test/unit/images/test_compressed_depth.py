import struct

import numpy as np
import pytest

from rosbot_patrol.errors import ImageError
from rosbot_patrol.images.compressed_depth import CompressedDepthParams, compress_depth, decompress_depth
from rosbot_patrol.images.encodings import Picture


def make_metres(*, width=64, height=48):
    depth = np.linspace(0.2, 12.0, width * height, dtype=np.float32).reshape(height, width, 1)
    depth[3, 5], depth[4, 5], depth[5, 5] = np.nan, np.inf, 0.0
    return Picture(depth, "32FC1")


def make_millimetres(seed=0, *, width=64, height=48, encoding="16UC1"):
    rng = np.random.default_rng(seed)
    values = rng.integers(0, 9999, (height, width, 1)).astype(np.uint16)
    return Picture(np.where(rng.random(values.shape) < 0.3, 0, values).astype(np.uint16), encoding)


@pytest.mark.parametrize("name", ["png", "rvl"])
def test_metres_come_back_as_exactly_as_their_quantum(name):
    picture = make_metres()
    text, data = compress_depth(picture, CompressedDepthParams(format=name))
    assert text == f"32FC1; compressedDepth {name}"
    assert struct.unpack_from("<i2f", data) == pytest.approx((0, 10100.0, -1009.0))
    back = decompress_depth(text, data)
    before, after = picture.pixels, back.pixels
    known = (before > 0) & (before < 10.0)
    assert (np.isnan(after) == ~known).all()
    # one step of the quantised inverse depth is depth^2 / 10100
    assert (np.abs(after[known] - before[known]) <= before[known] ** 2 / 10100.0 + 1e-4).all()


@pytest.mark.parametrize("encoding", ["16UC1", "mono16"])
@pytest.mark.parametrize("name", ["png", "rvl"])
def test_millimetres_come_back_as_they_were(name, encoding):
    picture = make_millimetres(encoding=encoding)
    text, data = compress_depth(picture, CompressedDepthParams(format=name))
    back = decompress_depth(text, data)
    assert back.encoding == encoding
    np.testing.assert_array_equal(back.pixels, picture.pixels)


def test_what_is_beyond_the_greatest_depth_is_unknown():
    picture = make_millimetres()
    back = decompress_depth(*compress_depth(picture, CompressedDepthParams(depth_max=3.0)))
    np.testing.assert_array_equal(back.pixels, np.where(picture.pixels > 3000, 0, picture.pixels))


def test_rvl_as_in_its_paper():
    """Two zeros, then 5, 3, 4: runs 2 and 3, differences 5, -2, 1 as 10, 3, 2; the first needs two nibbles."""
    values = np.array([[0, 0, 5, 3, 4]], np.uint16)[:, :, None]
    _, data = compress_depth(Picture(values, "16UC1"), CompressedDepthParams(format="rvl"))
    width, height, word = struct.unpack_from("<3I", data, 12)
    assert (width, height, len(data)) == (5, 1, 24)
    assert word == 0x23A13200


@pytest.mark.parametrize("values", [np.zeros((7, 9)), np.full((7, 9), 65535), np.arange(63).reshape(7, 9) * 1000])
def test_rvl_of_extremes(values):
    picture = Picture(values.astype(np.uint16)[:, :, None], "16UC1")
    params = CompressedDepthParams(format="rvl", depth_max=100.0)
    np.testing.assert_array_equal(decompress_depth(*compress_depth(picture, params)).pixels, picture.pixels)


def test_an_older_sender_names_no_format():
    _, data = compress_depth(make_millimetres(), CompressedDepthParams())
    assert decompress_depth("16UC1; compressedDepth", data).pixels.any()
    assert decompress_depth("16UC1", data).pixels.any()


@pytest.mark.parametrize("name", ["png", "rvl"])
def test_data_that_end_too_soon(name):
    text, data = compress_depth(make_millimetres(), CompressedDepthParams(format=name))
    for length in (0, 5, 12, 16, 21, 200):
        with pytest.raises(ImageError, match=f"bytes of the format '16UC1; compressedDepth {name}'"):
            decompress_depth(text, data[:length])


def test_rvl_that_lies_about_its_size():
    text, data = compress_depth(make_millimetres(), CompressedDepthParams(format="rvl"))
    for width, height in ((65, 48), (10, 10), (0, 48), (2**31, 2**31)):
        with pytest.raises(ImageError, match=rf"{width}x{height}"):
            decompress_depth(text, data[:12] + struct.pack("<2I", width, height) + data[20:])


def test_noise_as_data_is_refused_or_read():
    rng = np.random.default_rng(0)
    for _ in range(200):
        body = struct.pack("<2I", 8, 8) + rng.integers(0, 256, 64, dtype=np.uint8).tobytes()
        try:
            picture = decompress_depth("16UC1; compressedDepth rvl", bytes(12) + body)
        except ImageError:
            continue
        assert picture.pixels.shape == (8, 8, 1)


@pytest.mark.parametrize(
    "text", ["rgb8; jpeg compressed bgr8", "32FC1; compressedDepth zip", "8UC1; compressedDepth png"]
)
def test_formats_that_are_none(text):
    with pytest.raises(ImageError, match=f"the format '{text}' is not known here"):
        decompress_depth(text, bytes(100))


def test_colours_are_no_depth():
    with pytest.raises(ImageError, match="encoding rgb8 is no depth, expected 32FC1, 16UC1, mono16"):
        compress_depth(Picture(np.zeros((4, 4, 3), np.uint8), "rgb8"), CompressedDepthParams())
