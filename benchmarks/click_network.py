"""The networks that find the object of a click: crops about clicks (`click_crops`) in, their files out.

    python benchmarks/click_network.py crops FOLDER --photos ../shared/photos
    python benchmarks/click_network.py train FOLDER --photos ../shared/photos [--start FILE --rate 5e-4 --steps 6000 --seeds 0 1]
    python benchmarks/click_network.py object FOLDER --start click.onnx -o click.onnx

`train` makes the network of estimated depth. `object` gives a network its second output, whether an object is at the click at
all: a small network on its maps about the click, which leaves the first output as it is.

Crops are drawn by kind, so that none is lost among the others: clicks in photos, in worlds with estimated and with measured
depth, and on the background. Planes of saliency are zeros in some crops: an object need not be salient.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from click_crops import crops_of_photo, crops_of_world, write_crops
from click_photos import CUT_OUT, LEARNT, Object, clear_objects, photos_of, put_object
from click_training import RATE, CropFolder, expected_iou, train_seeds, varied
from dlama.geometry.rgbd import Float32Array
from dlama.models.network_file import NetworkFile
from dlama.perception.masks.click_network import PLANES, SALIENT, SIDE
from learning import learn
from shadow_export import OBJECT, export_shadow, read_shadow

KINDS = ("photo", "estimated", "measured", "background")
IN_BATCH = (5, 5, 3, 3)
"""Crops of each kind in a batch."""
DROPPED = 0.3
"""Share of crops without each plane of saliency."""
ON_CLICK, ELSEWHERE, LONGER_PX = 0.25, 0.15, (8, 64)
"""Share of crops of estimated depth with a cut-out put where the click is, which is the object then, and elsewhere; its longer
side. Depth and saliency do not show it, as they do not show small objects on large ones."""
NEARER = 2.5
"""Clicks on the background are seen from so much nearer at most."""
RARER, RAREST = 4.0, 6.0
"""An object's pixels weigh as a fourth of the square, up to so many times."""
HIDDEN, OBJECT_RATE, OBJECT_STEPS, OBJECT_BATCH, ON_BACKGROUND = 16, 1e-3, 3000, 256, 2.0
"""Of the layers that say whether an object is at the click: width, how they learn, and the weight of all clicks on the background
over that of all on objects, with which the least probability in `choice` fits both networks."""
ABOUT = {
    "dlama.what": "planes of a square about a click (dlama.perception.masks.click_network) -> logits of the object's pixels",
    "dlama.licence": "Apache-2.0",
}


class Crops(CropFolder):
    """The crops of a folder, drawn by kind."""

    def __init__(self, folder: Path, cut_outs: Sequence[Object], rng: np.random.Generator) -> None:
        super().__init__(folder)
        self.rng, self.cut_outs = rng, cut_outs
        self.numbers: dict[str, list[tuple[int, int]]] = {kind: [] for kind in KINDS}
        found = [truth[:, 0].any((1, 2)) for *_, truth in self.files]
        for (part, number), origin in self.origins.items():
            self.numbers[origin if found[part][number] else "background"].append((part, number))
        self.orders: dict[str, list[tuple[int, int]]] = {kind: [] for kind in KINDS}

    def batch(self) -> list[tuple[Float32Array, np.ndarray]]:
        """BATCH crops: all planes, and the object's share and what counts (2 x SIDE x SIDE)."""
        out = []
        for kind, count in zip(KINDS, IN_BATCH):
            for _ in range(count):
                if not self.orders[kind]:
                    numbers = self.numbers[kind]
                    self.orders[kind] = [numbers[each] for each in self.rng.permutation(len(numbers))]
                out.append(self.crop(kind, *self.orders[kind].pop()))
        return out

    def crop(self, kind: str, part: int, number: int) -> tuple[Float32Array, np.ndarray]:
        """As in `batch`: one crop, varied."""
        planes, salient, truth = (np.asarray(values[number], np.float32) for values in self.files[part])
        kept = self.rng.random((len(salient), 1, 1)) >= DROPPED
        crop = np.concatenate([planes, np.float32(salient / 255 * kept)])
        truth = truth / np.float32([[[255]], [[1]]])
        if kind == "background":
            crop = seen_nearer(crop, float(self.rng.uniform(1, NEARER)))
        if self.cut_outs and crop[PLANES.index("estimated")].any():
            put_cut_out(crop, truth, self.cut_outs, self.rng)
        return varied(crop, truth, self.rng)


def seen_nearer(planes: Float32Array, by: float) -> Float32Array:
    """A smaller square about the same click."""
    margin = int(SIDE / 2 * (1 - 1 / by))
    part = planes[:, margin : SIDE - margin, margin : SIDE - margin].transpose(1, 2, 0)
    out = cv2.resize(np.ascontiguousarray(part), (SIDE, SIDE)).transpose(2, 0, 1)
    for name in ("right", "down"):
        out[PLANES.index(name)] /= by
    out[PLANES.index("click")] = planes[PLANES.index("click")]
    return np.asarray(out, np.float32)


def put_cut_out(
    planes: Float32Array, truth: Float32Array, cut_outs: Sequence[Object], rng: np.random.Generator
) -> None:
    """Put a cut-out on a crop (planes and truth are changed): where the click is, elsewhere, or nowhere."""
    kind = rng.choice(3, p=(ON_CLICK, ELSEWHERE, 1 - ON_CLICK - ELSEWHERE))
    if kind == 2:
        return
    one = cut_outs[int(rng.integers(len(cut_outs)))]
    longer = float(np.exp(rng.uniform(*np.log(LONGER_PX))))
    middle = rng.integers(0, SIDE, 2)
    if kind == 0:
        inside = np.argwhere(one[1])
        low, high = inside.min(0), inside.max(0)
        middle = SIDE / 2 - longer / (high - low + 1).max() * (rng.choice(inside) - (low + high) / 2)
    levels = (planes[:3].transpose(1, 2, 0) + 1) * np.float32(127.5)
    seen = put_object(levels, one, longer, (int(middle[0]), int(middle[1])), rng)
    seen &= planes[PLANES.index("inside")] > 0.5
    near = slice(SIDE // 2 - 2, SIDE // 2 + 3)
    if kind == 0 and seen[SIDE // 2, SIDE // 2]:
        truth[:] = seen, np.ones_like(seen)
    elif kind == 1 and not seen[near, near].any():
        truth[0] *= ~seen
    else:
        return
    planes[:3] = (levels / 127.5 - 1).transpose(2, 0, 1) * planes[PLANES.index("inside")]


def loss_of(logits: Tensor, arrays: Tensor) -> Tensor:
    """Cross entropy of the pixels that count, and one less the expected intersection over union; mean over crops.

    arrays: B x 2 x SIDE x SIDE, the object's share and what counts.
    """
    targets, counts = arrays[:, 0], arrays[:, 1]
    area, pixels = (targets * counts).sum((1, 2)), counts.sum((1, 2)).clamp(min=1)
    gain = (pixels / (RARER * area.clamp(min=1))).clamp(1, RAREST)[:, None, None]
    entropy = binary_cross_entropy_with_logits(logits, targets, reduction="none") * counts * (1 + (gain - 1) * targets)
    return (entropy.sum((1, 2)) / pixels + 1 - expected_iou(logits, targets, counts)).mean()


def maps_at_clicks(start: Path, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """N x F: what the output `object` of the file `start` is to be made of, in all crops of the depth that it is for, and N,
    whether an object is at the click."""
    state, crops = read_shadow(start), Crops(folder, [], np.random.default_rng(0))
    channels = sum(len(state[f"up{number}.0.weight"]) for number in (4, 3, 2, 1))
    planes = state["down1.0.weight"].shape[1]
    as_they_are = np.eye(channels, dtype=np.float32), np.zeros(channels, np.float32)
    estimated = planes > len(PLANES)
    kinds = ("background", "estimated", "photo") if estimated else ("background", "measured")
    maps, there = list[np.ndarray](), list[bool]()
    with tempfile.TemporaryDirectory() as place:
        file = NetworkFile(export_shadow(state | dict(zip(OBJECT, as_they_are * 2)), Path(place) / "maps.onnx", {}))
        for kind in kinds:
            for part, number in crops.numbers[kind]:
                if crops.files[part][0][number, PLANES.index("estimated"), 0, 0] == estimated:
                    crop, _ = crops.crop(kind, part, number)
                    maps.append(file.run_all({"planes": crop[None, :planes]})[1][0])
                    there.append(kind != "background")
    return np.stack(maps), np.array(there)


def fit_object(maps: np.ndarray, there: np.ndarray) -> dict[str, np.ndarray]:
    """OBJECT of `maps_at_clicks`, learned by AdamW."""
    torch.manual_seed(0)
    rng, (mean, spread) = np.random.default_rng(0), (maps.mean(0), maps.std(0) + np.float32(1e-3))
    values, right = torch.from_numpy((maps - mean) / spread), torch.from_numpy(there.astype(np.float32))
    weight = torch.tensor((~there).sum() / (ON_BACKGROUND * there.sum()), dtype=torch.float32)
    first, second = torch.nn.Linear(maps.shape[1], HIDDEN), torch.nn.Linear(HIDDEN, 1)
    network = torch.nn.Sequential(first, torch.nn.ReLU(), torch.nn.Dropout(0.2), second)

    def loss_of_batch() -> Tensor:
        drawn = rng.integers(0, len(maps), OBJECT_BATCH)
        return binary_cross_entropy_with_logits(network(values[drawn])[:, 0], right[drawn], pos_weight=weight)

    list(learn(network.parameters(), loss_of_batch, OBJECT_STEPS, OBJECT_RATE))
    slopes, constants, last, end = (each.detach().numpy() for each in network.parameters())
    slopes = slopes.T / spread[:, None]
    return dict(zip(OBJECT, (slopes, constants - mean @ slopes, last.T, end)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("crops", "train", "object"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--worlds", type=int, default=880)
    parser.add_argument("--first", type=int, default=0, help="number of the first world")
    parser.add_argument("--photos", type=Path, help="a folder of folders of photos: textures, and pictures")
    parser.add_argument("--pictures", type=int, default=1600, help="photos, and photos with objects put on them")
    parser.add_argument("--steps", type=int, default=9500)
    parser.add_argument("--start", type=Path, help="a file to learn on from")
    parser.add_argument("--rate", type=float, default=RATE)
    parser.add_argument(
        "--seeds", type=int, nargs="+", default=[0], help="networks to learn from the same start; their mean ships"
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("estimated.onnx"))
    given = parser.parse_args()
    torch.set_num_threads(1)
    if given.what == "object":
        learned = fit_object(*maps_at_clicks(given.start, given.folder))
        export_shadow(read_shadow(given.start) | learned, given.output, ABOUT)
        return
    photos = photos_of(given.photos, LEARNT) if given.photos else []
    if given.photos and not photos:
        parser.error(f"{given.photos}: no folders with photos (*.jpg)")
    cut_outs = clear_objects(photos, CUT_OUT)
    if given.what == "crops":
        objects = clear_objects(photos)
        worlds = range(given.first, given.first + given.worlds)
        write_crops(given.folder, "world", worlds, lambda n: crops_of_world(n, photos, objects))
        if photos:
            pictures = range(given.pictures)
            write_crops(given.folder, "photo", pictures, lambda n: crops_of_photo(n, objects, cut_outs, photos))
        return
    learned = train_seeds(lambda rng: Crops(given.folder, cut_outs, rng), len(PLANES) + len(SALIENT), loss_of, given)
    export_shadow(learned, given.output, ABOUT)


if __name__ == "__main__":
    main()
