import io

import numpy as np
import pytest
from PIL import Image

from rosbot_patrol.alerts.pictures.jpeg import LabelledBox, RawPicture, to_jpeg
from rosbot_patrol.errors import AlertError

COLOUR = {"rgb8": (0, 200, 40), "bgr8": (40, 200, 0), "rgba8": (0, 200, 40, 255), "bgra8": (40, 200, 0, 255)}


def picture(encoding="rgb8", width=64, height=48, pad=0, data=None):
    pixel = COLOUR.get(encoding, (90,))
    step = width * len(pixel) + pad
    row = bytes(pixel) * width + bytes(pad)
    return RawPicture(
        stamp=1.0, width=width, height=height, encoding=encoding, step=step, data=row * height if data is None else data
    )


def decode(jpeg):
    return np.asarray(Image.open(io.BytesIO(jpeg)).convert("RGB")).astype(int)


@pytest.mark.parametrize("encoding", [*COLOUR])
@pytest.mark.parametrize("pad", [0, 5])
def test_colours_come_out_right(encoding, pad):
    pixels = decode(to_jpeg(picture(encoding, pad=pad)))
    assert pixels.shape == (48, 64, 3)
    assert np.abs(pixels - (0, 200, 40)).max() < 12


def test_grey():
    assert np.abs(decode(to_jpeg(picture("mono8"))) - 90).max() < 5


def test_boxes_are_drawn_where_they_are():
    box = LabelledBox(text="person 0.90", xmin=20, ymin=20, xmax=50, ymax=40)
    pixels = decode(to_jpeg(picture(), [box], quality=95))
    assert pixels[30, 21, 0] > 150
    assert pixels[30, 35, 0] < 60


@pytest.mark.parametrize("corners", [(-50, -50, 900, 900), (30, 40, 10, 5), (70, 60, 80, 90)])
def test_boxes_off_the_picture_do_no_harm(corners):
    box = LabelledBox(text="человек \n 0.9", xmin=corners[0], ymin=corners[1], xmax=corners[2], ymax=corners[3])
    assert decode(to_jpeg(picture(), [box])).shape == (48, 64, 3)


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (picture(data=b"short"), "64 x 48 rgb8 came with 5 bytes"),
        (RawPicture(stamp=0, width=4, height=4, encoding="bayer_rggb8", step=4, data=bytes(16)), "'bayer_rggb8'"),
        (RawPicture(stamp=0, width=0, height=0, encoding="rgb8", step=0, data=b""), "0 x 0"),
        (RawPicture(stamp=0, width=9, height=1, encoding="rgb8", step=3, data=bytes(99)), "9 x 1"),
    ],
)
def test_what_cannot_be_attached_is_said(bad, said):
    with pytest.raises(AlertError, match=said):
        to_jpeg(bad)


def test_a_label_at_the_right_edge_is_whole():
    def white(left):
        box = LabelledBox(text="person 0.87", xmin=left, ymin=30, xmax=left + 9, ymax=90)
        return (decode(to_jpeg(picture(width=200, height=100), [box])).min(axis=2) > 150).sum()

    assert white(190) > 0.8 * white(100)
