import struct

import numpy as np
import pytest

from rosbot_patrol.detection.darknet.cfg import parse_cfg
from rosbot_patrol.detection.darknet.random_weights import random_weights
from rosbot_patrol.detection.darknet.weights import ConvWeights, format_weights, parse_weights, read_weights
from rosbot_patrol.errors import DetectorError

SPEC = parse_cfg(
    "[net]\nwidth=32\nheight=32\nchannels=3\n[convolutional]\nbatch_normalize=1\nfilters=4\nsize=3\npad=1\n"
    "[convolutional]\nfilters=6\n[region]\nanchors=1,1\nclasses=1\nnum=1\n",
    "tiny.cfg",
)
SIZE = 20 + 4 * (4 * 4 + 4 * 3 * 9 + 6 + 6 * 4)


def make_bytes(seed=0):
    return format_weights(SPEC, random_weights(SPEC, np.random.default_rng(seed)))


def test_round_trip():
    written = random_weights(SPEC, np.random.default_rng(3))
    read = parse_weights(format_weights(SPEC, written, seen=64000), SPEC)
    for before, after in zip(written, read, strict=True):
        for name in ("weights", "biases", "scales", "means", "variances"):
            np.testing.assert_array_equal(getattr(before, name), getattr(after, name))


def test_numbers_rounded_to_half_precision_are_as_half_precision_has_them():
    written = random_weights(SPEC, np.random.default_rng(3))
    written[1].biases[:4] = 0.0, -1.5, 1.99999, -3e4
    read = parse_weights(format_weights(SPEC, written, bits=10), SPEC)
    for before, after in zip(written, read, strict=True):
        for name in ("weights", "biases"):
            half = getattr(before, name).astype(np.float16).astype(np.float32)
            np.testing.assert_allclose(getattr(after, name), half, rtol=2**-11, atol=1e-4)
            kept = getattr(after, name).view(np.uint32) & 0x1FFF
            assert not kept.any()
    assert read[1].biases[:4].tolist() == [0.0, -1.5, 2.0, -30000.0]


def test_order_in_the_file_is_biases_scales_means_variances_weights():
    numbers = np.frombuffer(make_bytes(), dtype="<f4", offset=20)
    first = parse_weights(make_bytes(), SPEC)[0]
    np.testing.assert_array_equal(numbers[:4], first.biases)
    np.testing.assert_array_equal(numbers[4:8], first.scales)
    np.testing.assert_array_equal(numbers[12:16], first.variances)
    np.testing.assert_array_equal(numbers[16:124], first.weights.ravel())


def test_older_header_counts_pictures_in_four_bytes():
    data = struct.pack("<4i", 0, 1, 0, 7) + make_bytes()[20:]
    np.testing.assert_array_equal(parse_weights(data, SPEC)[1].biases, parse_weights(make_bytes(), SPEC)[1].biases)


@pytest.mark.parametrize(("change", "word"), [(-1, "cut short"), (-600, "cut short"), (4, "too long")])
def test_wrong_length_names_both_sizes(change, word):
    data = make_bytes()
    data = data[:change] if change < 0 else data + bytes(change)
    with pytest.raises(DetectorError, match=f"house.weights is {word}.*has {SIZE + change} bytes.*needs {SIZE}"):
        parse_weights(data, SPEC, "house.weights")


def test_empty_file_names_both_sizes():
    with pytest.raises(DetectorError, match=f"has 0 bytes, tiny.cfg needs {SIZE}"):
        parse_weights(b"", SPEC)


def test_number_that_is_none_is_found():
    data = bytearray(make_bytes())
    data[100:104] = struct.pack("<f", float("nan"))
    with pytest.raises(DetectorError, match="byte 100 is not finite"):
        parse_weights(bytes(data), SPEC)


def test_missing_file_says_what_to_put_there(tmp_path):
    with pytest.raises(DetectorError, match=rf"none.weights is not there: put the file of {SIZE} bytes"):
        read_weights(str(tmp_path / "none.weights"), SPEC)


def test_batch_normalisation_is_folded():
    conv = ConvWeights(
        weights=np.full((1, 1, 1, 1), 2.0, np.float32),
        biases=np.array([0.5], np.float32),
        scales=np.array([3.0], np.float32),
        means=np.array([1.0], np.float32),
        variances=np.array([4.0], np.float32),
    )
    weights, biases = conv.folded()
    # 3 * (2 x - 1) / 2 + 0.5 = 3 x - 1
    assert weights.item() == pytest.approx(3.0, abs=1e-5)
    assert biases.item() == pytest.approx(-1.0, abs=1e-5)


def test_weights_that_do_not_fit_name_the_layer():
    layers = random_weights(SPEC, np.random.default_rng(0))
    layers[1] = ConvWeights(weights=np.zeros((6, 5, 1, 1), np.float32), biases=layers[1].biases)
    with pytest.raises(DetectorError, match=r"line 10: layer 1 needs weights \(6, 4, 1, 1\), got \(6, 5, 1, 1\)"):
        format_weights(SPEC, layers)
    with pytest.raises(DetectorError, match="has 2 convolutions, got weights of 1"):
        format_weights(SPEC, layers[:1])
