"""These need PyTorch, which only training needs: run them by `.ws/train/bin/python -m pytest` where it is installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="PyTorch is installed only in the environment of scripts/train_network")

from rosbot_patrol.detection.darknet_cfg import read_cfg  # noqa: E402
from rosbot_patrol.detection.darknet_weights import format_weights, parse_weights, weights_size  # noqa: E402
from rosbot_patrol.detection.training.loss import Truth, yolo_loss  # noqa: E402
from rosbot_patrol.detection.training.network import Darknet  # noqa: E402

SPEC = read_cfg(str(Path(__file__).parents[4] / "models" / "house.cfg"))


def test_weights_go_out_and_in_again() -> None:
    torch.manual_seed(0)
    network, other = Darknet(SPEC), Darknet(SPEC)
    network.train()
    network(torch.rand(4, 3, 256, 320))
    data = format_weights(SPEC, network.to_weights(), seen=5)
    assert len(data) == weights_size(SPEC) < 2_000_000
    other.from_weights(parse_weights(data, SPEC))
    picture = torch.rand(1, 3, 256, 320)
    with torch.inference_mode():
        pairs = zip(network.eval()(picture), other.eval()(picture), strict=True)
        assert all(torch.allclose(a, b, atol=1e-4) for a, b in pairs)


def test_the_loss_is_least_for_the_right_values_and_leads_there() -> None:
    torch.manual_seed(0)
    values = [torch.zeros(1, 21, *head.in_shape[1:], requires_grad=True) for head in SPEC.heads]
    truth = Truth(
        torch.tensor([[100.0, 120.0, 60.0, 150.0]]), torch.tensor([0]), torch.tensor([1]), torch.tensor([True])
    )
    optimiser = torch.optim.Adam(values, lr=0.1)
    losses = []
    for _ in range(150):
        optimiser.zero_grad()
        total = sum(yolo_loss(SPEC.heads, values, truth, SPEC.width).values())
        total.backward()
        optimiser.step()
        losses.append(float(total))
    assert losses[-1] < 0.1 * losses[0]
    from rosbot_patrol.detection.decode import decode
    from rosbot_patrol.detection.letterbox import Letterbox

    raw = [value.detach().numpy()[0] for value in values]
    found = decode(SPEC.heads, raw, Letterbox(320, 256, 320, 256), threshold=0.3, iou_threshold=0.4)
    assert np.allclose(found.boxes[0] * [320, 256, 320, 256], [100, 120, 60, 150], atol=4)
    assert found.probabilities[0].argmax() == 1


def test_what_is_not_asked_for_costs_nothing_either_way() -> None:
    values = [torch.zeros(1, 21, *head.in_shape[1:], requires_grad=True) for head in SPEC.heads]
    box = torch.tensor([[160.0, 128.0, 100.0, 200.0]])
    truth = Truth(box, torch.tensor([0]), torch.tensor([0]), torch.tensor([False]))
    sum(yolo_loss(SPEC.heads, values, truth, SPEC.width).values()).backward()
    head = SPEC.heads[0]
    gradient = values[0].grad.view(3, 7, *head.in_shape[1:])[:, 4]
    assert float(gradient[:, 4, 5].abs().max()) == 0.0
    assert float(gradient[:, 0, 0].abs().max()) > 0.0
