"""A network in training: its optimiser, a step, and the running mean of its numbers."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import torch

from rosbot_patrol.detection.darknet.layers import NetworkSpec
from rosbot_patrol.detection.darknet.weights import format_weights, read_weights
from training.learning.loss import Truth, yolo_losses
from training.learning.muon import StackedMuon
from training.learning.network import Darknet


class Learner:
    """A network that learns, and the running mean of its numbers (EMA), which is what is kept in the end.

    Args:
        spec: of the network.
        device: where it learns.
        rate: of learning, at its highest.
        muon: see `Optimiser`.
        bf16: compute in bfloat16 where that does, and where the machine does it itself (`computes_bf16`).
        compile_it: compile the network first, and on a GPU the loss with it.
    """

    def __init__(
        self,
        spec: NetworkSpec,
        device: torch.device,
        rate: float,
        *,
        muon: bool = False,
        bf16: bool = False,
        compile_it: bool = False,
    ) -> None:
        self.spec, self.device, self._bf16 = spec, device, bf16 and computes_bf16(device)
        network: Any = Darknet(spec)
        self.network: Darknet = network.to(device, memory_format=torch.channels_last)
        self.network.set_prior(0.01)
        self.mean = copy.deepcopy(self.network).eval()
        self._mean_values, self._values = (
            [value for value in part.state_dict().values() if value.dtype.is_floating_point]
            for part in (self.mean, self.network)
        )
        self.optimiser = Optimiser(self.network, rate, muon=muon)
        on_gpu = device.type == "cuda"
        self._forward = torch.compile(self.network) if compile_it and not on_gpu else self.network
        self._run = torch.compile(self._losses, dynamic=False) if compile_it and on_gpu else self._losses
        self.step = 0

    def learn(self, inputs: torch.Tensor, truth: Truth, rate: float) -> tuple[dict[str, torch.Tensor], torch.Tensor]:
        """One step.

        Args:
            inputs: pictures, shape (B, 3, height, width), 0 to 1, channels last.
            truth: what is in them.
            rate: of learning, now.

        Returns:
            What `yolo_losses` gives.
        """
        self.optimiser.set_rate(rate)
        parts, each = self._run(inputs, truth)
        self.network.zero_grad(set_to_none=True)
        loss: Any = sum(parts.values())
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 10.0)
        self.optimiser.step()
        self.step += 1
        keep = min(0.998, (1 + self.step) / (20 + self.step))
        with torch.no_grad():
            torch._foreach_lerp_(self._mean_values, self._values, 1 - keep)
        return {name: value.detach() for name, value in parts.items()}, each

    def _losses(self, inputs: torch.Tensor, truth: Truth) -> tuple[dict[str, torch.Tensor], torch.Tensor]:
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self._bf16):
            values = [value.float() for value in self._forward(inputs)]
        heads: Any = self.spec.heads  # all [yolo], or `Darknet` has refused the cfg
        return yolo_losses(heads, values, truth, self.spec.width)

    def weights(self, seen: int) -> bytes:
        """The running mean as a darknet file, rounded to half precision; `seen`: pictures that it has learnt."""
        return format_weights(self.spec, self.mean.to_weights(), seen=seen, bits=10)

    def state_dict(self) -> dict[str, Any]:
        """All of it, for a checkpoint."""
        return {
            "network": self.network.state_dict(),
            "mean": self.mean.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave."""
        self.network.load_state_dict(state["network"])
        self.mean.load_state_dict(state["mean"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.step = state["step"]

    def restart(self, file: Path | None) -> None:
        """Forget all steps; begin with the weights of a file, if there is one, else with those that are there."""
        if file is not None:
            self.start_from(file)
        self.optimiser.forget()
        self.step = 0

    def start_from(self, file: Path) -> None:
        """Begin with the weights of a checkpoint, or of a file in darknet's format."""
        if file.suffix == ".weights":
            self.network.from_weights(read_weights(str(file), self.spec))
        else:
            state = torch.load(file, map_location=self.device, weights_only=True)
            self.network.load_state_dict(state["mean"])
        self.mean.load_state_dict(self.network.state_dict())


class Optimiser:
    """AdamW for all numbers; or Muon for the inner convolutions and AdamW for the rest.

    Muon ("Muon: An optimizer for hidden layers in neural networks", Jordan et al. 2024) as PyTorch has it, for
    matrices only: a convolution is given to it as one, a row for each filter, that shares its numbers. The length of
    its steps is that of AdamW's ("Muon is Scalable for LLM Training", Liu et al. 2025), so that one rate serves both.
    """

    def __init__(self, network: Darknet, rate: float, *, muon: bool) -> None:
        convolutions = [m for m in network.modules() if isinstance(m, torch.nn.Conv2d)]
        inner = [c.weight for c in convolutions if c.in_channels > 3 and c.bias is None] if muon else []
        mine = {id(p) for p in inner}
        decayed = [p for p in network.parameters() if p.ndim > 1 and id(p) not in mine]
        plain = [p for p in network.parameters() if p.ndim <= 1]
        groups = [{"params": decayed, "weight_decay": 5e-3}, {"params": plain, "weight_decay": 0.0}]
        on_gpu, bf16 = plain[0].is_cuda, computes_bf16(plain[0].device)
        self._parts: list[torch.optim.Optimizer] = [torch.optim.AdamW(groups, lr=rate, fused=on_gpu)]
        self._pairs = [(p, torch.nn.Parameter(_as_matrix(p.data))) for p in inner]
        if any(p.data_ptr() != matrix.data_ptr() for p, matrix in self._pairs):
            raise RuntimeError("a convolution's numbers are not in one row after the other (channels last)")
        matrices = [matrix for _, matrix in self._pairs]
        if inner and (on_gpu or not bf16):
            dtype = torch.bfloat16 if bf16 else torch.float32
            self._parts.append(StackedMuon(matrices, rate, weight_decay=5e-3, dtype=dtype))
        elif inner:
            self._parts.append(torch.optim.Muon(matrices, lr=rate, weight_decay=5e-3, adjust_lr_fn="match_rms_adamw"))

    def set_rate(self, rate: float) -> None:
        """The learning rate from now on."""
        for part in self._parts:
            for group in part.param_groups:
                group["lr"] = rate

    def step(self) -> None:
        """One step by the gradients that the network's parameters have."""
        for p, matrix in self._pairs:
            matrix.grad = None if p.grad is None else _as_matrix(p.grad)
        for part in self._parts:
            part.step()

    def forget(self) -> None:
        """What is known of the steps before."""
        for part in self._parts:
            part.state.clear()

    def state_dict(self) -> list[dict[str, Any]]:
        """Of each part."""
        return [part.state_dict() for part in self._parts]

    def load_state_dict(self, states: list[dict[str, Any]]) -> None:
        """What `state_dict` gave."""
        if len(states) != len(self._parts):
            raise ValueError("the checkpoint is of another optimiser: give --muon as when it was begun")
        for part, state in zip(self._parts, states, strict=True):
            part.load_state_dict(state)


def _as_matrix(weights: torch.Tensor) -> torch.Tensor:
    return weights.permute(0, 2, 3, 1).reshape(len(weights), -1)


def computes_bf16(device: torch.device, cpuinfo: Path = Path("/proc/cpuinfo")) -> bool:
    """Whether bfloat16 is faster there than float32.

    PyTorch computes it on any processor, but where that has no instructions for it this takes more than twice as long.
    """
    if device.type != "cpu":
        return True
    lines = cpuinfo.read_text().splitlines()
    flags = next((line.split(":", 1)[1].split() for line in lines if line.startswith(("flags", "Features"))), [])
    return not {"avx512_bf16", "amx_bf16", "bf16"}.isdisjoint(flags)


def schedule(done: float, step: int, cool: float) -> float:
    """Share of the learning rate: up in 200 steps, level, and down as a cosine in the last `cool` of all.

    Level for long, so that a training can be made longer after its start ("Scaling Laws and Compute-Optimal Training
    Beyond Fixed Training Durations", Haegele et al. 2024).
    """
    warm = min(1.0, (step + 1) / 200)
    left = min(max(1 - done, 0.0) / max(cool, 1e-9), 1.0)
    return warm * (0.02 + 0.98 * 0.5 * (1 - math.cos(math.pi * left)))
