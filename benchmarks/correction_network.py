"""The network that corrects a mask at clicks: crops about corrective clicks (`correction_crops`) in, its file out.

    python benchmarks/correction_network.py crops FOLDER --photos ../shared/photos
    python benchmarks/correction_network.py train FOLDER --start estimated.onnx --steps 2500
    python benchmarks/correction_network.py train FOLDER --start correction.onnx --seeds 1 2

It is the network of clicks (`click_network`) with three more planes: the mask, and the clicks of both kinds. It also learns what
a box holds, which is the mask then, and to mend masks carried from other frames.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from click_crops import write_crops
from click_photos import CUT_OUT, LEARNT, clear_objects, photos_of
from click_training import CropFolder, expected_iou, train_seeds, varied
from correction_crops import crops_of_photo, crops_of_world
from dlama.geometry.rgbd import Float32Array
from dlama.perception.masks.click_network import PLANES
from shadow_export import export_shadow

KINDS, IN_BATCH, MAPS = ("photo", "estimated", "measured"), (6, 5, 5), 3
"""Crops of each kind in a batch; planes after PLANES: the mask, clicks, negative clicks."""
ENTROPY, WRONG = 1.5, 4.0
"""Weight of the cross entropy, and by how much more pixels count where the mask is wrong."""
ABOUT = {
    "dlama.what": "planes of a square about a click, a mask and all clicks (dlama.perception.masks.corrections) -> logits of the "
    "object's pixels",
    "dlama.licence": "Apache-2.0",
}


class CorrectionCrops(CropFolder):
    """The crops of a folder, drawn by kind."""

    def __init__(self, folder: Path, rng: np.random.Generator) -> None:
        super().__init__(folder)
        self.rng = rng
        self.numbers: dict[str, list[tuple[int, int]]] = {kind: [] for kind in KINDS}
        for place, origin in self.origins.items():
            self.numbers[origin].append(place)

    def batch(self) -> list[tuple[Float32Array, np.ndarray]]:
        """Crops: all planes, and the object's share, what counts and the wrong mask."""
        drawn = [
            self.numbers[kind][number]
            for kind, count in zip(KINDS, IN_BATCH)
            if self.numbers[kind]
            for number in self.rng.integers(0, len(self.numbers[kind]), count)
        ]
        return [self.crop(part, number) for part, number in drawn]

    def crop(self, part: int, number: int) -> tuple[Float32Array, np.ndarray]:
        """As in `batch`: one crop, varied."""
        planes, seen, truth = (np.asarray(values[number], np.float32) for values in self.files[part])
        truth, seen = truth / np.float32([[[255]], [[1]]]), seen / 255
        return varied(np.concatenate([planes, seen]), np.concatenate([truth, seen[:1]]), self.rng)


def loss_of(logits: Tensor, arrays: Tensor) -> Tensor:
    """Cross entropy of the pixels that count, more where the mask is wrong, and one less the expected intersection over union;
    mean over crops. arrays: B x 3 x SIDE x SIDE, as of a batch."""
    targets, counts, mask = arrays[:, 0], arrays[:, 1], arrays[:, 2]
    weights = counts * (1 + WRONG * (mask - targets).abs())
    entropy = binary_cross_entropy_with_logits(logits, targets, reduction="none") * weights
    pixels = counts.sum((1, 2)).clamp(min=1)
    return (ENTROPY * entropy.sum((1, 2)) / pixels + 1 - expected_iou(logits, targets, counts)).mean()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("crops", "train"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--worlds", type=int, default=410)
    parser.add_argument("--photos", type=Path, help="a folder of folders of photos: textures, and pictures")
    parser.add_argument("--pictures", type=int, default=1710, help="photos, and photos with objects put on them")
    parser.add_argument("--steps", type=int, default=4500)
    parser.add_argument("--start", type=Path, help="a file to learn on from")
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0], help="networks to learn; their mean ships")
    parser.add_argument("-o", "--output", type=Path, default=Path("correction.onnx"))
    given = parser.parse_args()
    torch.set_num_threads(1)
    if given.what == "crops":
        photos = photos_of(given.photos, LEARNT) if given.photos else []
        if given.photos and not photos:
            parser.error(f"{given.photos}: no folders with photos (*.jpg)")
        write_crops(given.folder, "world", range(given.worlds), lambda n: crops_of_world(n, photos))
        if photos:
            objects, cut_outs = clear_objects(photos), clear_objects(photos, CUT_OUT)
            pictures = range(given.pictures)
            write_crops(given.folder, "photo", pictures, lambda n: crops_of_photo(n, objects, cut_outs, photos))
        return
    learned = train_seeds(lambda rng: CorrectionCrops(given.folder, rng), len(PLANES) + MAPS, loss_of, given)
    export_shadow(learned, given.output, ABOUT)


if __name__ == "__main__":
    main()
