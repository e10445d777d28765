"""Muon for many matrices at once: the same steps as `torch.optim.Muon`, in a few large operations instead of thousands.

A GPU takes a tenth of the time for them that way. A processor that has no bfloat16 of its own takes 0.07 s instead of
0.25 for a step of the house network in float32, in which PyTorch's cannot; there nothing is filled up, for two cores
would take longer for that.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch

_COEFFICIENTS = (3.4445, -4.7750, 2.0315)
_STEPS = 5


class StackedMuon(torch.optim.Optimizer):
    """Muon (Jordan et al. 2024) with steps of AdamW's length (Liu et al. 2025), as `torch.optim.Muon` has it.

    Args:
        matrices: parameters of two dimensions.
        lr: learning rate.
        weight_decay: apart from the gradients, times the rate.
        momentum: of the mean of the gradients, by Nesterov.
        dtype: what to compute the steps in.
    """

    def __init__(
        self,
        matrices: Sequence[torch.nn.Parameter],
        lr: float,
        *,
        weight_decay: float = 0.1,
        momentum: float = 0.95,
        dtype: torch.dtype = torch.bfloat16,
    ) -> None:
        self._dtype = dtype
        super().__init__(matrices, {"lr": lr, "weight_decay": weight_decay, "momentum": momentum})

    @torch.no_grad()
    def step(self, closure: Any = None) -> Any:
        """One step by the gradients that the matrices have; those without one stay."""
        del closure
        for group in self.param_groups:
            mine = [p for p in group["params"] if p.grad is not None]
            if not mine:
                continue
            for p in mine:
                if "momentum_buffer" not in self.state[p]:
                    self.state[p]["momentum_buffer"] = torch.zeros_like(p)
            grads = [p.grad for p in mine]
            means = [self.state[p]["momentum_buffer"] for p in mine]
            torch._foreach_lerp_(means, grads, 1 - group["momentum"])
            ahead = torch._foreach_lerp(grads, means, group["momentum"])
            steps = orthogonal(ahead, self._dtype) if ahead[0].is_cuda else orthogonal_by_size(ahead, self._dtype)
            torch._foreach_mul_(mine, 1 - group["lr"] * group["weight_decay"])
            torch._foreach_mul_(steps, [-group["lr"] * 0.2 * max(p.shape) ** 0.5 for p in mine])
            torch._foreach_add_(mine, steps)


def orthogonal(matrices: Sequence[torch.Tensor], dtype: torch.dtype, epsilon: float = 1e-7) -> list[torch.Tensor]:
    """For each matrix nearly the orthogonal one next to it: five steps of Newton and Schulz, in `dtype`.

    All are filled up with zeros to one size, which changes nothing of the result.
    """
    rows, columns = (max(m.shape[i] for m in matrices) for i in (0, 1))
    stack = torch.zeros((len(matrices), rows, columns), dtype=dtype, device=matrices[0].device)
    parts = [stack[k, : m.shape[0], : m.shape[1]] for k, m in enumerate(matrices)]
    torch._foreach_copy_(parts, list(matrices))
    stack = stack / stack.float().norm(dim=(1, 2), keepdim=True).clamp(min=epsilon).to(dtype)
    a, b, c = _COEFFICIENTS
    for _ in range(_STEPS):
        gram = stack @ stack.mT
        stack = torch.baddbmm(stack, torch.baddbmm(gram, gram, gram, beta=b, alpha=c), stack, beta=a)
    return [stack[k, : m.shape[0], : m.shape[1]].to(m.dtype) for k, m in enumerate(matrices)]


def orthogonal_by_size(matrices: Sequence[torch.Tensor], dtype: torch.dtype) -> list[torch.Tensor]:
    """The same, those of one size together, so that nothing is filled up."""
    steps: list[torch.Tensor] = list(matrices)
    for shape in {m.shape for m in matrices}:
        alike = [k for k, m in enumerate(matrices) if m.shape == shape]
        for k, step in zip(alike, orthogonal([matrices[k] for k in alike], dtype), strict=True):
            steps[k] = step
    return steps
