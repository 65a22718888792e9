"""Training on one photo: L1 and hinge losses, a running mean of the weights, and what held-out cells say.

Nothing depends on how many steps are still to come: a training that goes on from its checkpoint ends as one
that was never interrupted.
"""

import time
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from p3i.paint.fill.npn.lessons import batch_of, varied
from p3i.paint.fill.npn.network import Batch, PaintingNetwork, PatchDiscriminator, plain
from p3i.paint.fill.npn.window import Stack

Progress = Callable[[int, int, float], None]
"""Told of step, of how many, and the mean L1 (0..255) over the latest holes."""

EVERY = 40
"""After so many steps the network is judged and the checkpoint written."""
_AT_ONCE = 2
_RATE = 2e-3
# The discriminator needs something to look at: it starts when the blend has settled.
_ADVERSARY_FROM = 80
_MEAN = 0.97
# What is taken for the error (0..1) where no cell is left to judge by.
_UNKNOWN = 0.03
_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass(slots=True)
class Training:
    """The state of one training. `best` holds the weights that painted the judges' holes best so far, the
    error that they left, and the share of the network that was best mixed into the plain fill."""

    generator: PaintingNetwork
    discriminator: PatchDiscriminator
    mean: PaintingNetwork
    generator_steps: torch.optim.Adam
    discriminator_steps: torch.optim.Adam
    step: int = 0
    best_weights: dict[str, Tensor] = field(default_factory=dict)
    best_error: float = float("inf")
    best_share: float = 0.0

    def state(self) -> dict[str, Any]:
        """All of it as tensors and numbers, to be saved."""
        return {
            "generator": self.generator.state_dict(),
            "discriminator": self.discriminator.state_dict(),
            "mean": self.mean.state_dict(),
            "generator_steps": self.generator_steps.state_dict(),
            "discriminator_steps": self.discriminator_steps.state_dict(),
            "step": self.step,
            "best": (self.best_weights, self.best_error, self.best_share),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""
        for name in ("generator", "discriminator", "mean", "generator_steps", "discriminator_steps"):
            getattr(self, name).load_state_dict(state[name])
        self.step = state["step"]
        self.best_weights, self.best_error, self.best_share = state["best"]


def begun(*, seed: int, device: torch.device) -> Training:
    """A training before its first step; leaves PyTorch's own source of chance as it was."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        generator, discriminator = PaintingNetwork(), PatchDiscriminator()
    generator, discriminator = generator.to(device), discriminator.to(device)
    return Training(
        generator,
        discriminator,
        deepcopy(generator),
        torch.optim.Adam(generator.parameters(), lr=_RATE, betas=(0.8, 0.99)),
        torch.optim.Adam(discriminator.parameters(), lr=_RATE, betas=(0.5, 0.99)),
    )


def train(
    training: Training,
    learned: list[Stack],
    judged: list[Stack],
    *,
    steps: int,
    seed: int,
    adversarial: float,
    until: float | None = None,
    save: Callable[[Training], None] | None = None,
    progress: Progress | None = None,
) -> None:
    """Train up to `steps` in all, or `until` the clock (time.monotonic) says so.

    `judged` may be empty: then the last weights count, halfway to the plain fill.
    """
    device = next(training.generator.parameters()).device
    whole = batch_of(learned, device=device)
    test = batch_of(judged, device=device) if judged else None
    latest = 0.0
    while training.step < steps and (until is None or time.monotonic() < until):
        # Each step has its own source of chance, so that no state of it need be kept.
        chance = torch.Generator().manual_seed(seed * 1_000_003 + training.step)
        chosen = torch.randint(len(learned), (min(_AT_ONCE, len(learned)),), generator=chance)
        batch = varied(_part(whole, chosen.to(device)), chance)
        error = _step(training, batch, adversarial=adversarial)
        latest = error if latest == 0 else 0.9 * latest + 0.1 * error
        training.step += 1
        if progress is not None:
            progress(training.step, steps, 255 * latest)
        if training.step % EVERY == 0:
            judge(training, test)
            if save is not None:
                save(training)
    if training.step % EVERY:
        # Saved before it is judged: one that goes on is not to be judged here.
        if save is not None:
            save(training)
        judge(training, test)


def judge(training: Training, test: Batch | None) -> None:
    """Keep the running mean of the weights if it paints the judges' holes better than any before."""
    if test is None:
        training.best_weights = deepcopy(training.mean.state_dict())
        # Nothing tells how good it is: half of it is taken.
        training.best_share, training.best_error = 0.5, _UNKNOWN
        return
    with torch.no_grad():
        start = plain(test).fill
        painted = torch.cat([training.mean(_part(test, place)).fill for place in _each(test)])
        errors = {share: _error(start + share * (painted - start), test).item() for share in _SHARES}
    share = min(_SHARES, key=lambda share: errors[share])
    if errors[share] < training.best_error:
        training.best_weights = deepcopy(training.mean.state_dict())
        training.best_error, training.best_share = errors[share], share


def _each(batch: Batch) -> Iterator[Tensor]:
    for place in range(len(batch.hole)):
        yield torch.tensor([place], device=batch.hole.device)


def _step(training: Training, batch: Batch, *, adversarial: float) -> float:
    """One step of both networks; returns the L1 over the holes before it."""
    painted = training.generator(batch).fill
    loss = error = _error(painted, batch)
    # Unknown ground looks the same in both, so it gives nothing away.
    outside = batch.target * batch.context
    fake = outside + painted * batch.hole
    against = adversarial > 0 and training.step >= _ADVERSARY_FROM
    if against:
        training.discriminator.requires_grad_(False)
        said = training.discriminator(fake, batch.hole)
        training.discriminator.requires_grad_(True)
        loss = error - adversarial * _inside(said, batch.hole)
    training.generator_steps.zero_grad(set_to_none=True)
    loss.backward()
    torch.nn.utils.clip_grad_norm_(training.generator.parameters(), 1.0)
    training.generator_steps.step()
    if against:
        real = outside + batch.target * batch.hole
        true = training.discriminator(real, batch.hole)
        false = training.discriminator(fake.detach(), batch.hole)
        judged = _inside(F.relu(1 - true), batch.hole) + _inside(F.relu(1 + false), batch.hole)
        training.discriminator_steps.zero_grad(set_to_none=True)
        judged.backward()
        training.discriminator_steps.step()
    with torch.no_grad():
        # Early steps count less, or the running mean would long remember the start.
        keep = min(_MEAN, (1 + training.step) / (10 + training.step))
        for mean, now in zip(training.mean.parameters(), training.generator.parameters(), strict=True):
            mean.lerp_(now, 1 - keep)
    return error.item()


def _inside(said: Tensor, hole: Tensor) -> Tensor:
    """The mean of what the discriminator says [B, 1, ~h / 4, ~w / 4] where its places see the hole."""
    weight = F.interpolate(hole, said.shape[-2:], mode="area") + 1e-3
    return (said * weight).sum() / weight.sum()


def _error(painted: Tensor, batch: Batch) -> Tensor:
    """Mean L1 over each hole, then over the holes: a large one counts no more than a small one."""
    apart = (painted - batch.target).abs().mean(1, keepdim=True) * batch.hole
    return (apart.sum((1, 2, 3)) / batch.hole.sum((1, 2, 3)).clamp(min=1)).mean()


def _part(batch: Batch, places: Tensor) -> Batch:
    return Batch(
        batch.target[places],
        batch.hole[places],
        batch.context[places],
        batch.sources[places],
        batch.lifts[places],
        batch.known[places],
        batch.weights[places],
    )
