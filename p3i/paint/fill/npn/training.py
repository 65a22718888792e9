"""Training: L1, sharpness and hinge losses, and a running mean of the weights.

Nothing depends on how many steps are still to come: a training that goes on from its checkpoint ends as one
that was never interrupted.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from p3i.paint.fill.npn.lessons import part_of, varied
from p3i.paint.fill.npn.network import Batch, PaintingNetwork, PatchDiscriminator

Progress = Callable[[int, int, float], None]
"""Told of step, of how many, and the mean L1 (0..255) over the latest holes."""

EVERY = 20
"""After so many steps the checkpoint is written."""
AT_ONCE = 4
"""Lessons of a step."""
_MEAN = 0.99
# What the other losses weigh beside the L1 in 0..1: the sharpness is a logarithm (0.1 for a tenth too soft).
_SHARPNESS, _ADVERSARY = 0.01, 0.001
# Differences of neighbours smaller than this are noise of 8 bits.
_FLAT = 0.004


@dataclass(slots=True)
class Training:
    """The state of one training; `mean` is the running mean of the generator's weights, which paints."""

    generator: PaintingNetwork
    discriminator: PatchDiscriminator
    mean: PaintingNetwork
    generator_steps: torch.optim.Adam
    discriminator_steps: torch.optim.Adam
    step: int = 0

    def state(self) -> dict[str, Any]:
        """All of it as tensors and numbers, to be saved."""
        names = ("generator", "discriminator", "mean", "generator_steps", "discriminator_steps")
        return {name: getattr(self, name).state_dict() for name in names} | {"step": self.step}

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""
        for name in ("generator", "discriminator", "mean", "generator_steps", "discriminator_steps"):
            getattr(self, name).load_state_dict(state[name])
        self.step = state["step"]


def begun(
    *, seed: int, device: torch.device, rate: float, weights: Mapping[str, Mapping[str, Tensor]] | None = None
) -> Training:
    """A training before its first step, from chance or from `weights` [...] of both networks.

    PyTorch's own source of chance is left as it was.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        generator, discriminator = PaintingNetwork(), PatchDiscriminator()
    if weights is not None:
        generator.load_state_dict(dict(weights["generator"]))
        discriminator.load_state_dict(dict(weights["discriminator"]))
    generator, discriminator = generator.to(device), discriminator.to(device)
    return Training(
        generator,
        discriminator,
        deepcopy(generator),
        torch.optim.Adam(generator.parameters(), lr=rate, betas=(0.8, 0.99)),
        torch.optim.Adam(discriminator.parameters(), lr=rate, betas=(0.5, 0.99)),
    )


def train(
    training: Training,
    learned: Sequence[Batch],
    *,
    steps: int,
    seed: int,
    until: float | None = None,
    save: Callable[[Training], None] | None = None,
    progress: Progress | None = None,
) -> None:
    """Train up to `steps` in all, or `until` the clock (time.monotonic) says so."""
    latest = 0.0
    sizes = torch.tensor([float(len(batch.weights)) for batch in learned])
    while training.step < steps and (until is None or time.monotonic() < until):
        # Each step has its own source of chance, so that no state of it need be kept.
        chance = torch.Generator().manual_seed(seed * 1_000_003 + training.step)
        batch = learned[int(torch.multinomial(sizes, 1, generator=chance))]
        count = len(batch.weights)
        chosen = torch.randperm(count, generator=chance)[:AT_ONCE]
        error = step(training, varied(part_of(batch, chosen.to(batch.weights.device)), chance))
        latest = error if latest == 0 else 0.9 * latest + 0.1 * error
        if progress is not None:
            progress(training.step, steps, 255 * latest)
        if save is not None and training.step % EVERY == 0:
            save(training)
    if save is not None and training.step % EVERY:
        save(training)


def step(training: Training, batch: Batch) -> float:
    """One step of both networks; returns the L1 over the holes before it."""
    painted = training.generator(batch).fill
    error = hole_error(painted, batch).mean()
    # Unknown ground looks the same in both, so it gives nothing away.
    outside = batch.target * batch.context
    fake = outside + painted * batch.hole
    training.discriminator.requires_grad_(False)
    said = training.discriminator(fake, batch.hole)
    training.discriminator.requires_grad_(True)
    dull = torch.log(sharpness(painted, batch.asked) / sharpness(batch.target, batch.asked)).abs().mean()
    loss = error + _SHARPNESS * dull - _ADVERSARY * _inside(said, batch.asked)
    training.generator_steps.zero_grad(set_to_none=True)
    loss.backward()
    torch.nn.utils.clip_grad_norm_(training.generator.parameters(), 1.0)
    training.generator_steps.step()
    real = outside + batch.target * batch.hole
    true = training.discriminator(real, batch.hole)
    false = training.discriminator(fake.detach(), batch.hole)
    judged = _inside(F.relu(1 - true), batch.asked) + _inside(F.relu(1 + false), batch.asked)
    training.discriminator_steps.zero_grad(set_to_none=True)
    judged.backward()
    training.discriminator_steps.step()
    training.step += 1
    with torch.no_grad():
        # Early steps count less, or the running mean would long remember the start.
        keep = min(_MEAN, (1 + training.step) / (10 + training.step))
        for mean, now in zip(training.mean.parameters(), training.generator.parameters(), strict=True):
            mean.lerp_(now, 1 - keep)
    return error.item()


def hole_error(painted: Tensor, batch: Batch) -> Tensor:
    """The mean L1 over what is asked for of each hole [B]: a large one counts no more than a small one."""
    apart = (painted - batch.target).abs().mean(1, keepdim=True) * batch.asked
    return apart.sum((1, 2, 3)) / batch.asked.sum((1, 2, 3)).clamp(min=1)


def sharpness(patches: Tensor, within: Tensor) -> Tensor:
    """The mean difference of neighbours [B] within a part [B, 1, h, w] of patches [B, 3, h, w]."""
    total, count = 0.0, 0.0
    for axis in (-1, -2):
        length = patches.shape[axis] - 1
        both = within.narrow(axis, 1, length) * within.narrow(axis, 0, length)
        apart = (
            (patches.narrow(axis, 1, length) - patches.narrow(axis, 0, length)).abs().mean(1, keepdim=True)
        )
        total = total + (apart * both).sum((1, 2, 3))
        count = count + both.sum((1, 2, 3))
    return total / torch.as_tensor(count).clamp(min=1) + _FLAT


def _inside(said: Tensor, hole: Tensor) -> Tensor:
    """The mean of what the discriminator says [B, 1, ~h / 4, ~w / 4] where its places see the hole."""
    weight = F.interpolate(hole, said.shape[-2:], mode="area") + 1e-3
    return (said * weight).sum() / weight.sum()
