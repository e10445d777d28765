"""These need PyTorch, which only training needs: run them by `.ws/train/bin/python -m pytest` where it is installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_networks import small_cfg

torch = pytest.importorskip("torch", reason="PyTorch is installed only in the environment of scripts/train_network")

from rosbot_patrol.detection.darknet.cfg import parse_cfg, read_cfg  # noqa: E402
from rosbot_patrol.detection.darknet.weights import format_weights, parse_weights, weights_size  # noqa: E402
from training.learning.learner import Learner, Optimiser, computes_bf16, schedule  # noqa: E402
from training.learning.loss import Truth, yolo_loss, yolo_losses  # noqa: E402
from training.learning.muon import StackedMuon, orthogonal, orthogonal_by_size  # noqa: E402
from training.learning.network import Darknet  # noqa: E402
from training.surgery.grow import grow  # noqa: E402

SPEC = read_cfg(str(Path(__file__).parents[2] / "models" / "house.cfg"))


def test_weights_go_out_and_in_again() -> None:
    torch.manual_seed(0)
    network, other = Darknet(SPEC), Darknet(SPEC)
    network.train()
    network(torch.rand(4, 3, 288, 384))
    data = format_weights(SPEC, network.to_weights(), seen=5)
    assert len(data) == weights_size(SPEC) < 20_000_000
    other.from_weights(parse_weights(data, SPEC))
    picture = torch.rand(1, 3, 288, 384)
    with torch.inference_mode():
        pairs = zip(network.eval()(picture), other.eval()(picture), strict=True)
        assert all(torch.allclose(a, b, atol=1e-4) for a, b in pairs)


SMALL = small_cfg()
LARGE = """
[net]
width=64
height=32
channels=3
[convolutional]
batch_normalize=1
filters=6
size=3
stride=2
pad=1
activation=leaky
[convolutional]
batch_normalize=1
filters=3
size=1
activation=leaky
[convolutional]
batch_normalize=1
filters=6
size=3
pad=1
activation=leaky
[shortcut]
from=-3
activation=linear
[convolutional]
filters=7
size=1
activation=linear
[yolo]
mask=0
anchors=10,20
classes=2
num=1
"""


def test_a_grown_network_answers_as_the_small_one_did() -> None:
    torch.manual_seed(3)
    small, large = parse_cfg(SMALL, "small"), parse_cfg(LARGE, "large")
    before = Darknet(small)
    before.train()
    before(torch.rand(8, 3, 32, 64))
    after = grow(small, before.to_weights(), large, {0: 0, 4: 1}).eval()
    picture = torch.rand(2, 3, 32, 64)
    with torch.inference_mode():
        assert torch.allclose(before.eval()(picture)[0], after(picture)[0], atol=1e-5)
    values = after.train()(picture)[0]
    values.square().sum().backward()
    assert all(float(p.grad.abs().max()) > 0 for p in after.blocks[2][1].parameters())


def test_a_pair_that_does_not_fit_is_refused() -> None:
    small, large = parse_cfg(SMALL, "small"), parse_cfg(LARGE, "large")
    with pytest.raises(ValueError, match="channels in"):
        grow(small, Darknet(small).to_weights(), large, {0: 0, 4: 0})


def test_the_rate_rises_stays_and_falls() -> None:
    shares = [schedule(step / 1000, step, 0.4) for step in (0, 300, 599, 800, 999, 1500)]
    assert shares == pytest.approx([1 / 200, 1.0, 1.0, 0.51, 0.02, 0.02], abs=2e-3)


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
    from rosbot_patrol.detection.darknet.decode import decode
    from rosbot_patrol.detection.darknet.letterbox import Letterbox

    raw = [value.detach().numpy()[0] for value in values]
    found = decode(SPEC.heads, raw, Letterbox(384, 288, 384, 288), threshold=0.3, iou_threshold=0.4)
    assert np.allclose(found.boxes[0] * [384, 288, 384, 288], [100, 120, 60, 150], atol=4)
    assert found.probabilities[0].argmax() == 1


def test_a_box_that_fits_is_to_be_as_sure_as_the_truth_says() -> None:
    values = [torch.zeros(1, 21, *head.in_shape[1:], requires_grad=True) for head in SPEC.heads]
    box, none = torch.tensor([[100.0, 120.0, 60.0, 150.0]]), torch.tensor([0])
    truth = Truth(box, none, none, torch.tensor([True]), sure=torch.tensor([0.65]))
    optimiser = torch.optim.Adam(values, lr=0.1)
    for _ in range(200):
        optimiser.zero_grad()
        sum(yolo_loss(SPEC.heads, values, truth, SPEC.width).values()).backward()
        optimiser.step()
    sure = max(float(v.detach().view(3, 7, *v.shape[2:])[:, 4].sigmoid().max()) for v in values)
    assert sure == pytest.approx(0.65, abs=0.03)


def test_what_is_not_asked_for_costs_nothing_either_way() -> None:
    values = [torch.zeros(1, 21, *head.in_shape[1:], requires_grad=True) for head in SPEC.heads]
    box = torch.tensor([[160.0, 128.0, 100.0, 200.0]])
    truth = Truth(box, torch.tensor([0]), torch.tensor([0]), torch.tensor([False]))
    sum(yolo_loss(SPEC.heads, values, truth, SPEC.width).values()).backward()
    head = SPEC.heads[0]
    gradient = values[0].grad.view(3, 7, *head.in_shape[1:])[:, 4]
    assert float(gradient[:, 4, 5].abs().max()) == 0.0
    assert float(gradient[:, 0, 0].abs().max()) > 0.0


def test_muon_moves_the_inner_convolutions_and_adamw_the_rest() -> None:
    torch.manual_seed(0)
    network = Darknet(parse_cfg(LARGE)).to(memory_format=torch.channels_last)
    optimiser = Optimiser(network, 1e-3, muon=True)
    before = {name: p.detach().clone() for name, p in network.named_parameters()}
    sum(head.square().mean() for head in network(torch.rand(2, 3, 32, 64))).backward()
    optimiser.set_rate(1e-2)
    optimiser.step()
    moved = {name: (p.detach() - before[name]) for name, p in network.named_parameters()}
    assert all(bool(step.abs().max() > 0) for step in moved.values())
    held = {tuple(matrix.shape) for part in optimiser.state_dict()[1:] for matrix in _buffers(part)}
    inner = [
        p for n, p in network.named_parameters() if p.ndim == 4 and p.shape[1] > 3 and f"{n[:-6]}bias" not in moved
    ]
    assert inner
    assert held == {(len(p), p.numel() // len(p)) for p in inner}
    for p, step in ((p, moved[name]) for name, p in network.named_parameters() if any(p is q for q in inner)):
        turned = step.permute(0, 2, 3, 1).reshape(len(p), -1)
        values = torch.linalg.svdvals(turned)  # as long in each direction: that is what Muon does
        assert float(values.max() / values.min()) < 4


def test_a_checkpoint_of_the_other_optimiser_is_refused() -> None:
    network = Darknet(parse_cfg(LARGE)).to(memory_format=torch.channels_last)
    with pytest.raises(ValueError, match="--muon"):
        Optimiser(network, 1e-3, muon=True).load_state_dict(Optimiser(network, 1e-3, muon=False).state_dict())


def _buffers(part: dict) -> list[torch.Tensor]:
    return [state["momentum_buffer"] for state in part["state"].values()]


def test_rows_that_only_fill_a_batch_up_change_nothing() -> None:
    torch.manual_seed(1)
    values = [torch.randn(4, 21, *head.in_shape[1:]) for head in SPEC.heads]
    boxes, batch = torch.rand(9, 4) * 90 + 10, torch.arange(9) % 4
    kinds, asked = torch.arange(9) % 2, torch.rand(9) < 0.7
    plain = yolo_loss(SPEC.heads, values, Truth(boxes, batch, kinds, asked), SPEC.width)
    none = torch.zeros(5, dtype=torch.bool)
    exists = torch.cat([torch.ones(9, dtype=torch.bool), none])
    more = [torch.zeros(5, 4), torch.arange(5) % 4, torch.zeros(5, dtype=torch.long), none]
    filled = [torch.cat(pair) for pair in zip((boxes, batch, kinds, asked), more, strict=True)]
    parts, each = yolo_losses(SPEC.heads, values, Truth(*filled, exists), SPEC.width)
    assert {k: float(v) for k, v in parts.items()} == pytest.approx({k: float(v) for k, v in plain.items()}, rel=1e-5)
    assert float(each.mean()) == pytest.approx(float(plain["object"]), rel=1e-5)
    assert each.shape == (4,)


@pytest.mark.parametrize(("dtype", "off"), [(torch.bfloat16, 2e-6), (torch.float32, 2e-4)])
def test_muon_of_many_matrices_at_once_steps_as_pytorchs_own(dtype: torch.dtype, off: float) -> None:
    torch.manual_seed(2)
    shapes = [(32, 64), (64, 288), (96, 240), (48, 48), (64, 288)]
    ours = [torch.nn.Parameter(torch.randn(shape) * 0.05) for shape in shapes]
    theirs = [torch.nn.Parameter(p.data.clone()) for p in ours]
    one = StackedMuon(ours, 3e-3, weight_decay=5e-3, dtype=dtype)
    other = torch.optim.Muon(theirs, lr=3e-3, weight_decay=5e-3, adjust_lr_fn="match_rms_adamw")
    for _ in range(4):
        for p, q in zip(ours, theirs, strict=True):
            p.grad = torch.randn_like(p)
            q.grad = p.grad.clone()
        one.step()
        other.step()
    for p, q in zip(ours, theirs, strict=True):
        assert torch.allclose(p, q, atol=off)


@pytest.mark.parametrize(("dtype", "off"), [(torch.bfloat16, 2e-2), (torch.float32, 1e-5)])
def test_what_matrices_are_filled_up_with_changes_nothing(dtype: torch.dtype, off: float) -> None:
    torch.manual_seed(3)
    matrices = [torch.randn(shape) for shape in [(32, 64), (64, 288), (96, 240), (48, 48), (64, 288)]]
    for one, other in zip(orthogonal(matrices, dtype), orthogonal_by_size(matrices, dtype), strict=True):
        assert torch.allclose(one, other, atol=off)


@pytest.mark.parametrize(
    ("line", "can"),
    [
        ("flags\t\t: fpu avx512f avx512_bf16 fsrm", True),
        ("flags\t\t: fpu amx_bf16", True),
        ("Features\t: fp asimd bf16", True),
        ("flags\t\t: fpu avx512f avx512_vnni", False),
        ("", False),
    ],
)
def test_bfloat16_is_for_a_machine_that_has_it(line: str, can: bool, tmp_path: Path) -> None:
    (tmp_path / "cpuinfo").write_text(f"processor\t: 0\n{line}\n")
    assert computes_bf16(torch.device("cpu"), tmp_path / "cpuinfo") is can
    assert computes_bf16(torch.device("cuda"), tmp_path / "cpuinfo")


def test_a_step_of_nothing_is_forgotten() -> None:
    torch.manual_seed(0)
    learner = Learner(parse_cfg(SMALL, "small"), torch.device("cpu"), 1e-3)
    before = {name: value.clone() for name, value in learner.network.state_dict().items()}
    truth = Truth(torch.tensor([[20.0, 16, 10, 20]]), torch.tensor([0]), torch.tensor([0]), torch.tensor([True]))
    learner.network.train()
    learner.learn(torch.rand(2, 3, 32, 64), truth, 1e-2)
    assert any(not torch.equal(before[name], value) for name, value in learner.network.state_dict().items())
    learner.network.load_state_dict(before)
    learner.restart(None)
    assert learner.step == 0
    assert not learner.optimiser._parts[0].state
