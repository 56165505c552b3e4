"""Crops about clicks in; a U-Net that learned from them out: what the networks of clicks and of corrections share."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from dlama.geometry.rgbd import Float32Array
from dlama.perception.masks.click_network import PLANES, SIDE
from learning import learn
from shadow_export import OBJECT, read_shadow
from shadow_net import ShadowNet

WIDTHS, RATE, WARM, DECAY, AVERAGED = (24, 40, 64, 96, 96), 2.5e-3, 100, 2e-2, 0.995
SMOOTH_PX = 5.0


class CropFolder:
    """The crops of a folder, as `click_crops.write_crops` writes them, by their origin; read when they are needed."""

    def __init__(self, folder: Path) -> None:
        names = [file.name.split(".")[0] for file in sorted(folder.glob("*.truth.npy"))]
        whats = ("planes", "salient", "truth")
        self.files = [[np.load(folder / f"{name}.{what}.npy", mmap_mode="r") for what in whats] for name in names]
        self.origins: dict[tuple[int, int], str] = {}
        """Number of the file and of the crop in it -> photo, or estimated or measured depth of a world."""
        for part, (name, (planes, *_)) in enumerate(zip(names, self.files)):
            for number, estimated in enumerate(planes[:, PLANES.index("estimated"), 0, 0] > 0):
                depth = "estimated" if estimated else "measured"
                self.origins[part, number] = "photo" if name.startswith("photo") else depth


class Batches(Protocol):
    """Crops that a network learns from."""

    numbers: dict[str, list[tuple[int, int]]]
    """Which there are, by kind."""

    def batch(self) -> list[tuple[Float32Array, np.ndarray]]:
        """Crops: all planes (P x SIDE x SIDE), and what `loss` compares them with (C x SIDE x SIDE)."""


def varied(planes: Float32Array, arrays: np.ndarray, rng: np.random.Generator) -> tuple[Float32Array, np.ndarray]:
    """A crop mirrored, in other colours, depth lost in a disc. arrays: further planes of the same crop, C x SIDE x SIDE."""
    color = planes[:3]
    if rng.random() < 0.3:
        color = color[rng.permutation(3)]
    if rng.random() < 0.1:
        color = np.repeat(color.mean(0, keepdims=True), 3, 0)
    color = np.clip(color * np.exp(rng.normal(0, 0.2)) + rng.normal(0, 0.1, (3, 1, 1)), -1, 1)
    if rng.random() < 0.3:
        color = color + rng.normal(0, rng.uniform(0, 0.08), color.shape)
    planes[:3] = color * planes[PLANES.index("inside")]
    if rng.random() < 0.15:
        row, column, radius = *rng.uniform(0, SIDE, 2), rng.uniform(3, 25)
        v, u = np.ogrid[:SIDE, :SIDE]
        gone = (v - row) ** 2 + (u - column) ** 2 < radius**2
        for name in ("distance", "known", "right", "down"):
            planes[PLANES.index(name)][gone] = 0
    if rng.random() < 0.5:
        planes, arrays = planes[:, :, ::-1].copy(), arrays[:, :, ::-1]
        planes[PLANES.index("right")] *= -1
    return planes, arrays


def expected_iou(logits: Tensor, targets: Tensor, counts: Tensor) -> Tensor:
    """Intersection over union of each crop, B, of the pixels that count."""
    said = logits.sigmoid() * counts
    both, sizes = (said * targets).sum((1, 2)), (said + targets * counts).sum((1, 2))
    return (both + SMOOTH_PX) / (sizes - both + SMOOTH_PX)


def with_planes(state: dict[str, np.ndarray], planes: int) -> dict[str, np.ndarray]:
    """The state of a network that sees other planes after PLANES, which ignores those that are new: from PLANES alone it answers
    as before."""
    weight = state["down1.0.weight"]
    if weight.shape[1] == planes:
        return state
    known = weight[:, : len(PLANES)]
    more = np.zeros((len(weight), planes - known.shape[1], *weight.shape[2:]), np.float32)
    return state | {"down1.0.weight": np.concatenate([known, more], 1)}


def train(
    crops: Batches,
    planes_seen: int,
    loss_of: Callable[[Tensor, Tensor], Tensor],
    steps: int,
    rate: float = RATE,
    start: Path | None = None,
    seed: int = 0,
) -> dict[str, np.ndarray]:
    """The state of a network: the mean of the network's weights over the last steps, by AdamW, its layers computed in bfloat16.

    planes_seen: how many planes it sees. start: a file that is learned on from; its batch norms, which are part of its
    convolutions, are not learned anew.
    """
    torch.manual_seed(seed)
    print(", ".join(f"{len(numbers)} {kind}" for kind, numbers in crops.numbers.items()), flush=True)
    network = ShadowNet(planes_seen, WIDTHS, deeper=True).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    if start is not None:
        state = {
            name: value for name, value in with_planes(read_shadow(start), planes_seen).items() if name not in OBJECT
        }
        network.load_state_dict({name: torch.from_numpy(value) for name, value in state.items()})
        network.eval()
    mean = {name: value.clone() for name, value in network.state_dict().items()}

    def loss_of_batch() -> Tensor:
        planes, arrays = (torch.from_numpy(np.stack(each).astype(np.float32)) for each in zip(*crops.batch()))
        with torch.autocast("cpu", torch.bfloat16):
            logits = network(planes.contiguous(memory_format=torch.channels_last))
        return loss_of(logits.float(), arrays)

    losses = list[float]()
    for loss in learn(network.parameters(), loss_of_batch, steps, rate, WARM, DECAY, clip=5.0):
        losses.append(loss)
        kept = min(AVERAGED, len(losses) / (len(losses) + 20))
        for name, value in network.state_dict().items():
            mean[name] = torch.lerp(value, mean[name], kept) if value.is_floating_point() else value.clone()
        if len(losses) % 200 == 0 or len(losses) == steps:
            print(f"step {len(losses)}: loss {np.mean(losses[-200:]):.3f}", flush=True)
    return {name: value.numpy() for name, value in mean.items()}


def train_seeds(
    crops_of: Callable[[np.random.Generator], Batches],
    planes_seen: int,
    loss_of: Callable[[Tensor, Tensor], Tensor],
    given: argparse.Namespace,
) -> dict[str, np.ndarray]:
    """The mean of the networks that `train` makes with each of given.seeds, from the same start (given: steps, rate, start)."""
    states = [
        train(crops_of(np.random.default_rng(seed)), planes_seen, loss_of, given.steps, given.rate, given.start, seed)
        for seed in given.seeds
    ]
    return {name: np.mean([state[name] for state in states], 0) for name in states[0]}
