"""The network that finds an object's shadow: trained on crops of procedural worlds, written as the file that ships.

    python benchmarks/shadow_classifier.py crops FOLDER --photos ../shared/photos
    python benchmarks/shadow_network.py FOLDER [-o src/dlama/assets/shadow/shadow.onnx]

It learns four crops in five of FOLDER/train (`benchmarks/shadow_net.py`); the fifth is for the classifiers that judge its answers
(`shadow_classifier.py train`), and its loss is printed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from dlama.perception.shadows.ground import SIDE
from dlama.perception.shadows.planes import FIRST_CAST, MULTIPLE, PLANES, ShadowPlanes, network_planes
from learning import learn
from shadow_crops import Crop, ShadowCrops
from shadow_export import export_shadow
from shadow_net import ShadowNet

FEWEST_PX = 25
"""Pixels of a crop's shadow that count as one."""
EPOCHS, BATCH, RATE, WARM, DECAY = 12, 8, 2e-3, 100, 2e-2
BUCKET = 64
"""Crops that are sorted by their size before they are put into batches."""
RARER, OVERLAP = 8.0, 0.5
"""A shadow's pixels weigh an eighth of the crop's at least, its overlap (Dice) so much next to the cross entropy."""
SMOOTH_PX = 20.0
SCALES, SCALED = (0.7, 1.1), 0.4
"""By how much crops are made smaller and larger, and how many of them."""
ABOUT = {
    "dlama.what": "planes of a crop round an object (dlama.perception.shadows) -> logits of the pixels of its shadow",
    "dlama.licence": "Apache-2.0",
}

Input = tuple[np.ndarray, np.ndarray]
"""The network's planes, and the share of each pixel that is shadow (-1: does not count)."""


def varied(known: ShadowPlanes, target: np.ndarray, rng: np.random.Generator) -> Input:
    """A crop mirrored, in another contrast and tint, at another scale, some thrown shapes left out."""
    planes = network_planes(known)
    if rng.random() < 0.5:
        planes, target = cv2.flip(planes.reshape(-1, target.shape[1]), 1).reshape(planes.shape), cv2.flip(target, 1)
        planes[PLANES.index("right")] *= -1
    contrast = np.float32(np.exp(rng.normal(0, 0.15)))
    planes[:3] = contrast * planes[:3] + rng.normal(0, 0.04, (3, 1, 1)) * planes[PLANES.index("picture")]
    for number in (PLANES.index("darkness"), PLANES.index("ambient"), -1):
        planes[number] *= contrast
    if rng.random() < 0.3:
        planes[:3] = planes[rng.permutation(3)]
    for number in range(FIRST_CAST, len(PLANES)):
        planes[number] *= 0 if rng.random() < 0.12 else np.clip(1 + rng.normal(0, 0.1), 0, 1.2)
    if rng.random() < SCALED:
        scale = rng.uniform(*SCALES)
        high, wide = (int(np.clip(round(n * scale / MULTIPLE), 1, SIDE // MULTIPLE)) * MULTIPLE for n in target.shape)
        how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        planes = np.stack([cv2.resize(plane, (wide, high), interpolation=how) for plane in planes])
        target = cv2.resize(target, (wide, high), interpolation=cv2.INTER_NEAREST)
    return planes, target


def batch_of(crops: Sequence[Input]) -> tuple[Tensor, Tensor]:
    """B x planes x H x W and B x H x W, as large as the largest of them."""
    high, wide = (max(target.shape[axis] for _, target in crops) for axis in (0, 1))
    planes = np.zeros((len(crops), len(crops[0][0]), high, wide), np.float32)
    targets = np.full((len(crops), high, wide), -1, np.float32)
    for number, (each, target) in enumerate(crops):
        planes[number, :, : target.shape[0], : target.shape[1]] = each
        targets[number, : target.shape[0], : target.shape[1]] = target
    return torch.from_numpy(planes).contiguous(memory_format=torch.channels_last), torch.from_numpy(targets)


def loss_of(logits: Tensor, targets: Tensor) -> Tensor:
    """Cross entropy of the pixels that count, and the overlap with the shadow where there is one; means over crops."""
    counts, true = (targets >= 0).float(), targets.clamp(0, 1)
    pixels, area = counts.sum((1, 2)).clamp(min=1), (true * counts).sum((1, 2))
    weight = (pixels / (RARER * area.clamp(min=1))).clamp(1, RARER)[:, None, None]
    entropy = binary_cross_entropy_with_logits(logits, true, reduction="none") * counts * (1 + (weight - 1) * true)
    said = logits.sigmoid() * counts
    both, sizes = (said * true).sum((1, 2)), (said**2 + true**2 * counts).sum((1, 2))
    apart = 1 - (2 * both + SMOOTH_PX) / (sizes + SMOOTH_PX)
    return (entropy.sum((1, 2)) / pixels + OVERLAP * (area >= FEWEST_PX / 2) * apart).mean()


def batches(sizes: np.ndarray, rng: np.random.Generator) -> list[np.ndarray]:
    """Numbers of crops of about one size, in a drawn order. sizes: N x 2."""
    order = rng.permutation(len(sizes))
    buckets = [order[start : start + BUCKET] for start in range(0, len(order), BUCKET)]
    order = np.concatenate([bucket[np.lexsort(sizes[bucket].T)] for bucket in buckets])
    every = [order[start : start + BATCH] for start in range(0, len(order) - BATCH + 1, BATCH)]
    return [every[n] for n in rng.permutation(len(every))]


def trained(crops: Sequence[Crop], others: Sequence[Crop], epochs: int, seed: int) -> ShadowNet:
    """The network after `epochs`, by AdamW, its layers computed in bfloat16; the loss of `others` is printed."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    network = ShadowNet(len(network_planes(crops[0][0]))).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    drawn = (
        numbers for _ in range(epochs) for numbers in batches(np.array([target.shape for _, target in crops]), rng)
    )

    def loss_of_batch() -> Tensor:
        planes, targets = batch_of([varied(*crops[n], rng) for n in next(drawn)])
        with torch.autocast("cpu", torch.bfloat16):
            logits = network.train()(planes)
        return loss_of(logits.float(), targets)

    each, losses = len(crops) // BATCH, list[float]()
    for loss in learn(network.parameters(), loss_of_batch, epochs * each, RATE, WARM, DECAY):
        losses.append(loss)
        epoch = len(losses) / each
        if epoch % 3 == 0 or epoch == epochs:
            print(
                f"epoch {epoch:.0f}: loss {np.mean(losses[-each:]):.3f}, {mean_loss(network, others):.3f} of others",
                flush=True,
            )
    return network.eval()


@torch.no_grad()
def mean_loss(network: ShadowNet, crops: Sequence[Crop]) -> float:
    network.eval()
    pairs = (batch_of([(network_planes(planes), target)]) for planes, target in crops)
    return float(np.mean([float(loss_of(network(planes), targets)) for planes, targets in pairs]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("shadow.onnx"))
    parser.add_argument("--epochs", type=int, default=EPOCHS)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    torch.set_num_threads(1)
    crops, others = ShadowCrops.of(given.folder / "train").fifths()
    print(f"{len(crops)} crops, {len(others)} others", flush=True)
    network = trained(crops, others, given.epochs, given.seed)
    state = {name: tensor.numpy() for name, tensor in network.state_dict().items()}
    export_shadow(state, given.output, ABOUT)


if __name__ == "__main__":
    main()
