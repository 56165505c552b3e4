"""The network that finds the object of a click: crops of procedural worlds in, the file that ships out.

    python benchmarks/click_network.py crops FOLDER --photos ../shared/photos
    python benchmarks/click_network.py train FOLDER [--start FILE --rate 6e-4 --steps 3000] [-o src/dlama/assets/click/click.onnx]

A crop is a square about a click on an object, as `click_network.click_planes` cuts it: one of most of the picture, one about the
object. Half of the worlds have objects on islands, plinths and tables, half are crowded (`click_clutter`); two sensors of
`world_cases.SENSORS` see each picture. Photos are textures of six worlds in ten, and pictures themselves
(`click_photos`): worlds alone teach a network that a patch of colour on a car or a frog is an object.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.random import Generator
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from click_photos import LEARNT, Object, clear_objects, photo_with_objects, photos_of
from click_worlds import ClickWorld, objects_in_sight
from dlama.evaluation.metrics.masks import innermost_pixel, largest_region
from dlama.geometry.holes import dilate_mask
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.masks.click_network import FIRST_WINDOW, PLANES, SIDE, click_planes
from dlama.perception.masks.prompt import Pixel
from dlama.training.data.photos import square_crop
from shadow_export import export_shadow, read_shadow
from shadow_net import ShadowNet
from world_cases import SENSORS, as_seen

FIRST_WORLD, PICTURE_PX, VIEWS, MOST_OBJECTS = 1_007_000_000, 448, 2, 6
STANDS, CROWDED, NEAR = 0.5, 0.5, 0.35
"""Share of worlds with islands and plinths, of crowded ones, and of views from near."""
SENSOR_SHARES = (0.12, 0.28, 0.2, 0.4)
SHARES, FARTHEST_M, ONE_PIECE = (0.002, 0.25), 9.0, 0.7
"""Of objects: share of the picture, median depth, least share that hangs together."""
TEXTURED, TEXTURES, TEXTURE_PX = 0.6, 8, 256
CUT_OFF, ANYWHERE, CLICKS_IN_PHOTO = 0.3, 0.4, 2
"""Share of views with objects that the rim cuts, and of clicks anywhere on an object, not amid it; clicks on
an object of a photo."""
FAR_SCALES, NEAR_SCALES, LEAST_REACH = (0.8, 1.2), (1.15, 2.2), 6
"""Sides of the two squares: over FIRST_WINDOW of the picture, and over twice the object's reach from the click (px)."""
PER_FILE = 20
WIDTHS, BATCH, RATE, WARM, DECAY, AVERAGED = (24, 40, 64, 96, 96), 16, 2.5e-3, 100, 2e-2, 0.995
RARER, RAREST, SMOOTH_PX = 4.0, 6.0, 5.0
"""An object's pixels weigh as a fourth of the square, up to so many times."""
ABOUT = {
    "dlama.what": "planes of a square about a click (dlama.perception.masks.click_network) -> logits of the object's pixels",
    "dlama.licence": "Apache-2.0",
}


Crop = tuple[Float32Array, np.ndarray, np.ndarray]
"""Planes, the object's share of each pixel (uint8), and which pixels count (what stands on the object does not)."""


def crops_of_world(number: int, photos: Sequence[Path]) -> Iterator[Crop]:
    """The crops of a world's objects."""
    rng = np.random.default_rng([number, 77])
    textures = []
    if photos and rng.random() < TEXTURED:
        for file in rng.choice(np.array(photos, object), TEXTURES):
            picture = cv2.imread(str(file))[..., ::-1]
            textures.append(square_crop(np.ascontiguousarray(picture), TEXTURE_PX, rng))
    stands, crowded = (bool(rng.random() < share) for share in (STANDS, CROWDED))
    made = ClickWorld(FIRST_WORLD + number, tuple(textures), stands=stands, crowded=crowded)
    for _ in range(VIEWS):
        scene = made.scene(made.world.camera(float(rng.uniform(-60, 60)), PICTURE_PX, float(rng.uniform(55, 95))))
        scene = made.near_scene(scene, rng) if rng.random() < NEAR else scene
        seen = rng.permutation(objects_in_sight(scene, *SHARES, cut_off=rng.random() < CUT_OFF)).tolist()
        objects = [each for each in seen if np.median(scene.frame.depth[scene.mask(each)]) < FARTHEST_M][:MOST_OBJECTS]
        for sensor in rng.choice(SENSORS, 2, replace=False, p=SENSOR_SHARES) if objects else ():
            frame = as_seen(scene.frame, sensor, rng)
            for each in objects:
                yield from crops_of_click(frame, scene.mask(each), scene.on_it(each), rng)


def crops_of_photo(number: int, objects: Sequence[Object], grounds: Sequence[Path]) -> Iterator[Crop]:
    """As `crops_of_world`, of objects in a photo (`click_photos`)."""
    rng = np.random.default_rng([number, 78])
    frame, masks = photo_with_objects(objects, grounds, rng, put=number % 2 > 0)
    for mask in masks if frame is not None else ():
        for _ in range(CLICKS_IN_PHOTO if mask.mean() > SHARES[0] else 0):
            yield from crops_of_click(frame, mask, np.zeros_like(mask), rng)


def crops_of_click(frame: RGBD, mask: BoolArray, on_it: BoolArray, rng: Generator) -> Iterator[Crop]:
    """Two crops of a click on an object (H x W mask; `on_it`: what stands on it); none of an object in pieces."""
    if (largest_region(dilate_mask(mask, 2)) & mask).sum() < ONE_PIECE * mask.sum():
        return
    column, row = innermost_pixel(mask)
    if rng.random() < ANYWHERE:
        row, column = (int(at) for at in rng.choice(np.argwhere(mask)))
    reach = max(float(np.abs(np.argwhere(mask) - (row, column)).max()), LEAST_REACH)
    first = FIRST_WINDOW * max(mask.shape) * rng.uniform(*FAR_SCALES)
    for side in first, 2 * reach * rng.uniform(*NEAR_SCALES):
        pixel, radius = (row, column), int(side / 2)
        target, other = (share_in_square(where, pixel, radius) for where in (mask, on_it))
        yield click_planes(frame, pixel, radius), np.uint8(255 * target), np.uint8(other < 0.5)


def share_in_square(where: BoolArray, pixel: Pixel, radius: int) -> Float32Array:
    """SIDE x SIDE share of `where` in the square of 2 radius + 1 px about (row, column)."""
    padded = np.pad(where.astype(np.float32), radius)
    part = padded[pixel[0] : pixel[0] + 2 * radius + 1, pixel[1] : pixel[1] + 2 * radius + 1]
    how = cv2.INTER_AREA if len(part) > SIDE else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(part, (SIDE, SIDE), interpolation=how), np.float32)


def write_crops(folder: Path, kind: str, numbers: range, crops: Callable[[int], Iterator[Crop]]) -> None:
    """Two files for PER_FILE worlds or pictures; those that are there stay. Not compressed: training reads single crops."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in (numbers[first : first + PER_FILE] for first in range(0, len(numbers), PER_FILE)):
        file = folder / f"{kind}-{part[0]:05d}.truth.npy"
        if not file.exists():
            planes, *truth = zip(*(crop for number in part for crop in crops(number)))
            np.save(
                file.with_name(f"{kind}-{part[0]:05d}.planes.npy"),
                np.stack([each.astype(np.float16) for each in planes]),
            )
            np.save(file, np.stack([np.stack(each) for each in truth], 1))
            print(f"{file.name}: {len(planes)} crops", flush=True)


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


def loss_of(logits: Tensor, targets: Tensor, counts: Tensor) -> Tensor:
    """Cross entropy of the pixels that count, and one less the expected intersection over union; mean over crops."""
    area, pixels = (targets * counts).sum((1, 2)), counts.sum((1, 2)).clamp(min=1)
    gain = (pixels / (RARER * area.clamp(min=1))).clamp(1, RAREST)[:, None, None]
    entropy = binary_cross_entropy_with_logits(logits, targets, reduction="none") * counts * (1 + (gain - 1) * targets)
    said = logits.sigmoid() * counts
    both, sizes = (said * targets).sum((1, 2)), (said + targets * counts).sum((1, 2))
    return (entropy.sum((1, 2)) / pixels + 1 - (both + SMOOTH_PX) / (sizes - both + SMOOTH_PX)).mean()


def train(folder: Path, steps: int, rate: float = RATE, start: Path | None = None, seed: int = 0) -> ShadowNet:
    """The mean of the network's weights over the last steps, by AdamW, its layers computed in bfloat16.

    start: a file that is learned on from; its batch norms, which are part of its convolutions, are not learned anew.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    names = [file.name.split(".")[0] for file in sorted(folder.glob("*.truth.npy"))]
    files = [[np.load(folder / f"{name}.{what}.npy", mmap_mode="r") for what in ("planes", "truth")] for name in names]
    numbers = [(part, number) for part, (_, truth) in enumerate(files) for number in range(len(truth))]
    network = ShadowNet(len(PLANES), WIDTHS, deeper=True).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    if start is not None:
        network.load_state_dict({name: torch.from_numpy(value) for name, value in read_shadow(start).items()})
        network.eval()
    mean = {name: value.clone() for name, value in network.state_dict().items()}
    optimiser = torch.optim.AdamW(network.parameters(), rate, weight_decay=DECAY)
    losses, order = list[float](), np.zeros(0, int)
    for step in range(steps):
        if len(order) < BATCH:
            order = rng.permutation(len(numbers))
        drawn, order = order[:BATCH], order[BATCH:]
        for group in optimiser.param_groups:
            group["lr"] = rate * min(1, (step + 1) / WARM) * 0.5 * (1 + np.cos(np.pi * step / steps))
        crops = []
        for part, number in (numbers[each] for each in drawn):
            planes, truth = (np.asarray(values[number], np.float32) for values in files[part])
            crops.append(varied(planes, truth / np.float32([[[255]], [[1]]]), rng))
        planes, arrays = (torch.from_numpy(np.stack(each).astype(np.float32)) for each in zip(*crops))
        with torch.autocast("cpu", torch.bfloat16):
            logits = network(planes.contiguous(memory_format=torch.channels_last))
        loss = loss_of(logits.float(), arrays[:, 0], arrays[:, 1])
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimiser.step()
        kept = min(AVERAGED, (step + 1) / (step + 21))
        for name, value in network.state_dict().items():
            mean[name] = torch.lerp(value, mean[name], kept) if value.is_floating_point() else value.clone()
        losses.append(float(loss.detach()))
        if step % 200 == 199 or step == steps - 1:
            print(f"step {step + 1}: loss {np.mean(losses[-200:]):.3f}", flush=True)
    network.load_state_dict(mean)
    return network.eval()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("crops", "train"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--worlds", type=int, default=880)
    parser.add_argument("--first", type=int, default=0, help="number of the first world")
    parser.add_argument("--photos", type=Path, help="a folder of folders of photos: textures, and pictures")
    parser.add_argument("--pictures", type=int, default=1600, help="photos, and photos with objects put on them")
    parser.add_argument("--steps", type=int, default=9500)
    parser.add_argument("--start", type=Path, help="a file to learn on from")
    parser.add_argument("--rate", type=float, default=RATE)
    parser.add_argument("-o", "--output", type=Path, default=Path("click.onnx"))
    given = parser.parse_args()
    torch.set_num_threads(1)
    if given.what == "crops":
        photos = photos_of(given.photos, LEARNT) if given.photos else []
        if given.photos and not photos:
            parser.error(f"{given.photos}: no folders with photos (*.jpg)")
        write_crops(
            given.folder, "world", range(given.first, given.first + given.worlds), lambda n: crops_of_world(n, photos)
        )
        if photos:
            objects = clear_objects(photos)
            write_crops(given.folder, "photo", range(given.pictures), lambda n: crops_of_photo(n, objects, photos))
        return
    state = {
        name: value.numpy()
        for name, value in train(given.folder, given.steps, given.rate, given.start).state_dict().items()
    }
    export_shadow(state, given.output, ABOUT)


if __name__ == "__main__":
    main()
