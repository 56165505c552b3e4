"""An index in -> a sample of a flat scene out, drawn in milliseconds: rectangles before a slanted ground (kind `sketch`).

As in real samples, the hole is what a rectangle hides from the source camera and the target camera sees, its depth is behind the
rectangle, and the truth is known. For tests and for the preset `tiny`.
"""

from __future__ import annotations

import numpy as np

from dlama.training.settings import NetworkSettings

COUNT = 1 << 20
"""Of different scenes."""


class ToyScenes:
    """See `sources.SampleSource`. Held-out scenes are drawn from other random numbers than trained ones."""

    def __init__(self, network: NetworkSettings, size: int, split: str) -> None:
        self.network, self.size, self.salt = network, size, {"train": 0, "held_out": 1}[split]

    def __len__(self) -> int:
        return COUNT

    def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """One sample; keys and shapes as `batches.Batch`."""
        draw = np.random.default_rng([self.salt, index, int(rng.integers(1 << 31))])
        color, depth, hole, limit = _scene(draw, self.size)
        if self.network.kind.views == 2:
            return _pair(color, hole, draw, self.network.kind.masks)
        target = color if not self.network.kind.has_depth else np.concatenate([color, depth[None]])
        mask = hole[None].astype(np.float32)
        made = {"input": np.concatenate([target * (1 - mask), mask]), "target": target, "mask": mask}
        if self.network.kind.has_depth:
            made |= {"known_depth": np.ones_like(mask), "limit": limit[None]}
        return made


def _scene(rng: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Colour 3 x S x S, inverse depth, hole, and the law's limit (S x S each)."""
    v, u = np.mgrid[0:size, 0:size].astype(np.float32) / np.float32(size)
    depth = (0.1 + 0.4 * v * rng.uniform(0.5, 1)).astype(np.float32)
    color = _texture(rng, u, v)
    hole, limit = np.zeros((size, size), bool), np.full((size, size), np.inf, np.float32)
    for _ in range(int(rng.integers(1, 4))):
        top, left = rng.integers(0, size * 3 // 4, 2)
        high, wide = rng.integers(size // 8, size // 2, 2)
        near, gap = np.float32(rng.uniform(0.6, 1)), int(rng.integers(2, max(3, size // 8)))
        here = np.s_[top : top + high, left : left + wide]
        strip = np.s_[top : top + high, max(left - gap, 0) : left]
        color[:, here[0], here[1]] = _texture(rng, u, v)[:, here[0], here[1]]
        depth[here], hole[here], limit[here] = near, False, np.inf
        hole[strip], limit[strip] = True, near
    if not hole.any():  # every rectangle began at the left border
        hole[size // 4 : size // 2, size // 4 : size // 2] = True
    limit[~hole] = np.inf
    limit[hole] = np.maximum(limit[hole], depth[hole])
    return color, (depth / depth.max()).astype(np.float32), hole, (limit / depth.max()).astype(np.float32)


def _texture(rng: np.random.Generator, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """3 x S x S: a colour gradient under stripes."""
    start, along, down = rng.uniform(0.1, 0.6, 3), rng.uniform(-0.2, 0.3, 3), rng.uniform(-0.2, 0.3, 3)
    stripes = rng.uniform(0, 0.1) * np.sin(rng.uniform(5, 40) * u + rng.uniform(5, 40) * v)
    planes = start[:, None, None] + along[:, None, None] * u + down[:, None, None] * v + stripes
    return np.clip(planes, 0, 1).astype(np.float32)


def _pair(color: np.ndarray, hole: np.ndarray, rng: np.random.Generator, masks: int) -> dict[str, np.ndarray]:
    """A flat wall seen by two cameras: the right picture is the left one, moved."""
    shift = -int(rng.integers(1, 1 + color.shape[2] // 16))
    target = np.concatenate([color, np.roll(color, shift, 2)])
    each = np.stack([hole, np.roll(hole, shift, 1)]).astype(np.float32)
    mask = each if masks == 2 else each.max(0, keepdims=True)
    known = target * (1 - mask.repeat(6 // masks, 0))
    return {"input": np.concatenate([known, mask]), "target": target, "mask": mask}
