"""The neural painting network: a U-Net over a set of aligned sources, blind to their order.

Every source is encoded with the corrupted patch by the same weights; at each scale the set is pooled, by mean
and maximum over the sources (Aittala and Durand 2018, Qi et al. 2017, as the paper's supplement B cites), and
one decoder runs over the pooled scales. What it decodes is which source to believe at each pixel, how much of
the sources' membranes to take, and a correction in colour: see docs/npn.md for what departs from the paper.

Convention: B patches of K sources, [B, K, C, h, w]; colours in 0..1; `known` 1 where a source is evidence.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

WIDTHS = (16, 32, 32)
"""Channels of the three scales."""
_KEY = 16
_INPUTS = 16
_PLANES = ("target", "hole", "context", "sources", "lift", "known", "asked")
# A source that is unknown at a pixel gets this logit there.
_NEVER = -30.0


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Stacks of one size: `target` [B, 3, h, w] with the truth in the hole where known, `hole` and `context`
    [B, 1, h, w], `sources` [B, K, 3, h, w] in the hole's light, the membrane `lift` [B, 3, h, w], `known`
    [B, K, 1, h, w], `weights` [B, K] (0 for a place that holds no source), `asked` [B, 1, h, w] what is
    painted of the hole. The network reads the target in the context only."""

    target: Tensor
    hole: Tensor
    context: Tensor
    sources: Tensor
    lift: Tensor
    known: Tensor
    weights: Tensor
    asked: Tensor

    def seen(self, view: Callable[[Tensor], Tensor]) -> "Batch":
        """The batch with each of its planes [..., h, w] seen another way."""
        return replace(self, **{name: view(getattr(self, name)) for name in _PLANES})


@dataclass(frozen=True, slots=True, eq=False)
class Painted:
    """What the network says: `attention` [B, K, 1, h, w] (sum 1), `strength` [B, 1, h, w] of the membrane,
    `correction` [B, 3, h, w], and the patch that they make, `fill` [B, 3, h, w]."""

    attention: Tensor
    strength: Tensor
    correction: Tensor
    fill: Tensor


def blend(batch: Batch, attention: Tensor, strength: Tensor, correction: Tensor) -> Tensor:
    """The patch [B, 3, h, w] of an attention, a strength and a correction."""
    return (attention * batch.sources).sum(1) + strength * batch.lift + correction


def plain_logits(batch: Batch) -> Tensor:
    """The logits [B, K, 1, h, w] of the weighted mean that the network starts from."""
    weights = torch.log(batch.weights.clamp(min=1e-12))[:, :, None, None, None]
    return torch.where(batch.known > 0.5, weights, _NEVER + 0.1 * weights)


def plain(batch: Batch) -> Painted:
    """The weighted mean of the sources with their membranes: what the network says before training."""
    attention = torch.softmax(plain_logits(batch), 1)
    strength, correction = torch.ones_like(batch.hole), torch.zeros_like(batch.target)
    return Painted(attention, strength, correction, blend(batch, attention, strength, correction))


class PaintingNetwork(nn.Module):
    """The generator. Untrained it paints `plain`: all that it adds to that starts at zero."""

    def __init__(self) -> None:
        super().__init__()
        first, second, third = WIDTHS
        self.encode0 = nn.Conv2d(_INPUTS, first, 3, padding=1)
        self.share0 = nn.Conv2d(2 * first, first, 1)
        self.encode1 = nn.Conv2d(first, second, 3, padding=1)
        self.share1 = nn.Conv2d(2 * second, second, 1)
        self.encode2 = nn.Conv2d(second, third, 3, padding=1)
        self.share2 = nn.Conv2d(2 * third, third, 1)
        self.decode2 = nn.Conv2d(2 * third, third, 3, padding=1)
        self.decode1 = nn.Conv2d(third + 2 * second, second, 3, padding=1)
        self.decode0 = nn.Conv2d(second + 2 * first, first, 3, padding=1)
        self.keys = nn.ModuleList(nn.Conv2d(width, _KEY, 1) for width in WIDTHS)
        self.queries = nn.ModuleList(nn.Conv2d(width, _KEY, 1) for width in WIDTHS)
        self.strength = nn.Conv2d(first, 1, 1)
        self.correction = nn.Conv2d(first, 3, 1)
        for part in (*self.queries, self.strength, self.correction):
            layer = cast(nn.Conv2d, part)
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(cast(Tensor, layer.bias))

    def forward(self, batch: Batch) -> Painted:
        """Paint the holes of a batch; the order of the sources makes no difference but rounding."""
        count = batch.sources.shape[1]
        present = (batch.weights > 0).float()[:, :, None, None, None]
        inputs = _inputs(batch)
        scales: list[Tensor] = []
        pooled: list[Tensor] = []
        features = inputs.flatten(0, 1)
        for scale, (encode, share) in enumerate(
            ((self.encode0, self.share0), (self.encode1, self.share1), (self.encode2, self.share2))
        ):
            if scale:
                features = F.avg_pool2d(features, 2, ceil_mode=True, count_include_pad=False)
            own = encode(features)
            seen = _pooled(F.leaky_relu(own, 0.1).unflatten(0, (-1, count)), present)
            mixed = F.leaky_relu(own.unflatten(0, (-1, count)) + share(seen)[:, None], 0.1)
            scales.append(mixed)
            pooled.append(_pooled(mixed, present))
            features = mixed.flatten(0, 1)
        decoded2 = F.leaky_relu(self.decode2(pooled[2]), 0.1)
        decoded1 = F.leaky_relu(self.decode1(torch.cat([_grown(decoded2, pooled[1]), pooled[1]], 1)), 0.1)
        decoded0 = F.leaky_relu(self.decode0(torch.cat([_grown(decoded1, pooled[0]), pooled[0]], 1)), 0.1)
        logits = plain_logits(batch)
        for features, decoded, key, query in zip(
            scales, (decoded0, decoded1, decoded2), self.keys, self.queries, strict=True
        ):
            keys = key(features.flatten(0, 1)).unflatten(0, (-1, count))
            match = (keys * query(decoded)[:, None]).sum(2, keepdim=True).flatten(0, 1)
            logits = logits + _grown(match, batch.hole).unflatten(0, (-1, count))
        attention = torch.softmax(logits, 1)
        strength = 1 + self.strength(decoded0)
        correction = 0.2 * torch.tanh(self.correction(decoded0))
        return Painted(attention, strength, correction, blend(batch, attention, strength, correction))


class PatchDiscriminator(nn.Module):
    """Says of each place of a completed patch how real it looks; it is told where the hole was."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(4, 16, 4, stride=2, padding=1),
            nn.LeakyReLU(0.2),
            nn.Conv2d(16, 32, 4, stride=2, padding=1),
            nn.LeakyReLU(0.2),
            nn.Conv2d(32, 1, 3, padding=1),
        )

    def forward(self, patch: Tensor, hole: Tensor) -> Tensor:
        """Patches [B, 3, h, w] with holes [B, 1, h, w] -> [B, 1, ~h / 4, ~w / 4]."""
        return self.layers(torch.cat([4 * (patch - 0.5), hole], 1))


def _inputs(batch: Batch) -> Tensor:
    """What each source is encoded from [B, K, 16, h, w]: itself, the corrupted patch, and the set's mean."""
    attention = torch.softmax(plain_logits(batch), 1)
    lifted = batch.sources + batch.lift[:, None]
    mean = (attention * lifted).sum(1)
    spread = (attention * (lifted - mean[:, None]) ** 2).sum(1).mean(1, keepdim=True).add(1e-6).sqrt()
    apart = batch.context[:, None] * batch.known * (batch.sources - batch.target[:, None])
    shape = batch.known.shape
    trust = 0.3 * torch.log(batch.weights.clamp(min=1e-4))[:, :, None, None, None]
    return torch.cat(
        [
            4 * (lifted - mean[:, None]) * batch.known,
            4 * apart,
            (4 * batch.lift)[:, None].expand_as(lifted),
            batch.known,
            trust.expand(shape),
            (2 * mean - 1)[:, None].expand(-1, shape[1], -1, -1, -1),
            (8 * spread)[:, None].expand(shape),
            batch.hole[:, None].expand(shape),
        ],
        2,
    )


def _pooled(features: Tensor, present: Tensor) -> Tensor:
    """Mean and maximum over the set: [B, K, C, h, w] -> [B, 2C, h, w]."""
    mean = (features * present).sum(1) / present.sum(1)
    most = features.masked_fill(present < 0.5, -torch.inf).amax(1)
    return torch.cat([mean, most], 1)


def _grown(features: Tensor, like: Tensor) -> Tensor:
    if features.shape[-2:] == like.shape[-2:]:
        return features
    return F.interpolate(features, like.shape[-2:], mode="bilinear", align_corners=False)
