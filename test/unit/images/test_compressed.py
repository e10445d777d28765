import cv2
import numpy as np
import pytest

from rosbot_patrol.errors import ImageError
from rosbot_patrol.images.compressed import CompressedParams, compress, decompress
from rosbot_patrol.images.encodings import ENCODINGS, Picture

COLOURS = ("rgb8", "bgr8", "rgba8", "bgra8")


def make_picture(encoding, *, width=64, height=48):
    known = ENCODINGS[encoding]
    small = np.random.default_rng(0).integers(0, 255, (6, 8, known.channels), dtype=np.uint8)
    pixels = cv2.resize(small, (width, height)).reshape(height, width, -1)
    return Picture(pixels.astype(known.dtype) * (257 if known.dtype == "u2" else 1), encoding)


@pytest.mark.parametrize("encoding", [*COLOURS, "mono8"])
def test_jpeg_round_trip_keeps_encoding_and_colours(encoding):
    picture = make_picture(encoding)
    text, data = compress(picture, CompressedParams(jpeg_quality=95))
    back = decompress(text, data)
    assert back.encoding == encoding
    difference = back.to("rgb8").pixels.astype(int) - picture.to("rgb8").pixels
    assert np.abs(difference).mean() < 4


@pytest.mark.parametrize(
    "encoding", ["rgb8", "bgr8", "mono8", "mono16", "16UC1", "bayer_grbg8", "bayer_rggb16", "8UC1"]
)
def test_png_round_trip_loses_nothing(encoding):
    picture = make_picture(encoding)
    text, data = compress(picture, CompressedParams(format="png", png_level=1))
    back = decompress(text, data)
    assert back.encoding == encoding
    np.testing.assert_array_equal(back.pixels, picture.pixels)


def test_text_is_upstreams():
    assert compress(make_picture("rgb8"), CompressedParams())[0] == "rgb8; jpeg compressed bgr8"
    assert compress(make_picture("mono8"), CompressedParams(format="png"))[0] == "mono8; png compressed "


def test_mono16_as_jpeg_keeps_its_range():
    text, data = compress(make_picture("mono16"), CompressedParams())
    back = decompress(text, data)
    assert back.encoding == "mono16"
    assert np.abs(back.pixels.astype(int) - make_picture("mono16").pixels).mean() < 4 * 257


@pytest.mark.parametrize("encoding", ["rgb16", "bgra16", "yuv422", "bayer_rggb16"])
def test_what_no_jpeg_can_hold_travels_as_8_bits_a_colour(encoding):
    picture = make_picture(encoding)
    text, data = compress(picture, CompressedParams(jpeg_quality=95))
    assert text.partition(";")[0] in COLOURS
    difference = decompress(text, data).to("rgb8").pixels.astype(int) - picture.to("rgb8").pixels
    assert np.abs(difference).mean() < 6


def test_modes():
    text, data = compress(make_picture("rgb8"), CompressedParams())
    assert decompress(text, data, mode="gray").encoding == "mono8"
    assert decompress(text, data, mode="color").encoding == "rgb8"
    text, data = compress(make_picture("mono8"), CompressedParams())
    assert decompress(text, data, mode="color").encoding == "bgr8"


def test_format_of_an_old_sender_names_no_encoding():
    _, data = compress(make_picture("rgb8"), CompressedParams())
    assert decompress("jpeg", data).encoding == "bgr8"


def test_quality_makes_it_larger():
    small, large = (len(compress(make_picture("rgb8"), CompressedParams(jpeg_quality=q))[1]) for q in (20, 95))
    assert small < large


@pytest.mark.parametrize("data", [b"", b"\x00\x01\x02", b"\xff\xd8\xff\xe0 no jpeg at all"])
def test_broken_bytes_are_a_sentence(data):
    with pytest.raises(ImageError, match=rf"{len(data)} bytes of the format 'rgb8; jpeg compressed bgr8'"):
        decompress("rgb8; jpeg compressed bgr8", data)


@pytest.mark.parametrize("encoding", [*COLOURS, "mono8", "8UC3"])
@pytest.mark.parametrize("change", [{"jpeg_progressive": True}, {"jpeg_optimize": True}, {"jpeg_restart_interval": 4}])
def test_the_special_kinds_of_jpeg_show_the_same(encoding, change):
    picture = make_picture(encoding)
    plain = decompress(*compress(picture, CompressedParams(jpeg_quality=95)))
    text, data = compress(picture, CompressedParams(jpeg_quality=95, **change))
    special = decompress(text, data)
    assert special.encoding == plain.encoding
    assert np.abs(special.pixels.astype(int) - plain.pixels).mean() < 2
    marker = {"jpeg_progressive": b"\xff\xc2", "jpeg_restart_interval": b"\xff\xdd\x00\x04\x00\x04"}
    assert marker.get(next(iter(change)), b"") in data


@pytest.mark.parametrize("special", [False, True])
@pytest.mark.parametrize(("width", "height"), [(70000, 1), (0, 0)])
def test_a_size_that_no_jpeg_has_is_a_sentence(special, width, height):
    picture = Picture(np.zeros((height, width, 3), np.uint8), "rgb8")
    with pytest.raises(ImageError, match=f"{width}x{height}"):
        compress(picture, CompressedParams(jpeg_progressive=special))


@pytest.mark.parametrize("encoding", [*COLOURS, "mono8", "8UC3", ""])
@pytest.mark.parametrize("flag", [{}, {"jpeg_progressive": True}])
def test_a_jpeg_reads_as_opencv_reads_it(encoding, flag):
    _, data = compress(make_picture(encoding or "bgr8", width=61, height=33), CompressedParams(**flag))
    ours = decompress(f"{encoding}; jpeg compressed bgr8" if encoding else "jpeg", data)
    theirs = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(ours.to("bgr8").pixels.astype(int) - theirs).max() <= 1
    assert ours.encoding == {"": "bgr8", "8UC3": "bgr8"}.get(encoding, encoding)


def test_a_grey_jpeg_is_grey_whatever_its_format_says():
    _, data = compress(make_picture("mono8"), CompressedParams())
    back = decompress("rgb8; jpeg compressed bgr8", data)
    assert (back.encoding, back.pixels.shape) == ("mono8", (48, 64, 1))


def test_half_a_jpeg_is_read_as_far_as_it_goes_or_is_a_sentence():
    picture = make_picture("rgb8", width=320, height=240)
    text, data = compress(picture, CompressedParams())
    back = decompress(text, data[: len(data) // 2])  # as upstream's, whose OpenCV says so on stderr
    assert back.pixels.shape == (240, 320, 3)
    assert np.abs(back.pixels[:60].astype(int) - picture.pixels[:60]).mean() < 12
    with pytest.raises(ImageError):
        decompress(text, data[:100])


def test_a_part_of_a_picture_is_compressed_as_it_is():
    whole = make_picture("rgb8")
    part = Picture(whole.pixels[4:30, 8:40], "rgb8")
    copied = Picture(part.pixels.copy(), "rgb8")
    assert compress(part, CompressedParams()) == compress(copied, CompressedParams())


def test_unknown_encoding_in_the_format():
    with pytest.raises(ImageError, match="'nv21'"):
        decompress("nv21; jpeg compressed bgr8", b"x")


def test_depth_is_refused():
    with pytest.raises(ImageError, match="32FC1"):
        compress(Picture(np.zeros((4, 4, 1), np.float32), "32FC1"), CompressedParams())
