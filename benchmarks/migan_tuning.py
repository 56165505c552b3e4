"""Crops with guesses in; MI-GAN's generator tuned on their holes for some minutes, and what it then errs on held-out ones, out.

    python benchmarks/migan_tuning.py FOLDER --minutes 12 [--looks 3] [--seed 0] [--without-planes] [--sheet FILE.png]

FOLDER is one of `python benchmarks/choice.py crops`. The generator that ships is run by torch, in single precision. It is given
further planes by a convolution beside its first layer, zero at first, so that training begins at MI-GAN: colours and inverse
depth of the guess `layered`, known inverse depth, hole types. Nothing is written but the sheet. Printed over the colour holes of
held-out crops: mean absolute and squared error (0..1), LPIPS over the share of the hole, and the mean difference of LPIPS from
MI-GAN's on the same crops, with its standard error.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import cv2
import numpy as np
import onnx
import onnxruntime
import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.nn import functional

from choice import color_errors
from dlama.evaluation.metrics.lpips import Lpips
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.inpainters import ASSETS
from dlama.inpainters.networks.migan import NETWORK_SIDE, find_cracks
from dlama.training.data.guess_crops import INDEX, LEVELS, GuessCrop, read_crop
from dlama.training.losses.lpips import LpipsLoss

FURTHER = ("red", "green", "blue", "depth", "known depth", "disoccluded", "out of view", "object")
"""Planes that MI-GAN does not know; the first four are the guess `layered`."""
SHIPPED = ASSETS / "migan" / "migan-512.onnx"
LEAST_HOLE = 0.01
"""Crops with a smaller share of colour hole do not count."""
FASTER = 10
"""The new convolution, which begins at zero, learns so many times as fast."""
SHOWN = 6
"""Crops on the sheet."""

Fill = Callable[[GuessCrop], UInt8Array]
"""A crop -> S x S x 3."""


class Generator(nn.Module):
    """The graph of an ONNX file of convolutions, leaky ReLUs and sums, its constants as parameters in single precision."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        graph = onnx.load(path).graph
        tensors = {one.name: numpy_helper.to_array(one).astype(np.float32) for one in graph.initializer}
        self.constants = nn.ParameterDict({name: torch.from_numpy(array.copy()) for name, array in tensors.items()})
        self.entrance, self.exit = graph.input[0].name, graph.output[0].name
        self.nodes = [(one.op_type, list(one.input), one.output[0], attributes(one)) for one in graph.node]
        first = next(inputs[1] for kind, inputs, _, _ in self.nodes if kind == "Conv" and inputs[0] == self.entrance)
        self.further = nn.Conv2d(len(FURTHER), len(tensors[first]), 3, padding=1, bias=False)
        nn.init.zeros_(self.further.weight)

    def forward(self, planes: Tensor, further: Tensor | None = None) -> Tensor:
        """B x 4 x S x S (colours, 0 in the hole; 1 = fill) and B x FURTHER x S x S -> B x 3 x S x S, unbounded."""
        values: dict[str, Any] = {self.entrance: planes, **self.constants}
        for kind, inputs, output, about in self.nodes:
            x, *rest = (values[name] for name in inputs)
            if kind == "Conv":
                x = functional.conv2d(x, *rest, **about)
                if inputs[0] == self.entrance and further is not None:
                    x = x + self.further(further)
            elif kind == "ConvTranspose":
                x = functional.conv_transpose2d(x, *rest, **about)
            elif kind == "LeakyRelu":
                x = functional.leaky_relu(x, **about)
            elif kind == "Add":
                height, width = x.shape[-2:]
                x = x + rest[0][..., :height, :width]  # noise belongs to 512 x 512; smaller pictures take its corner
            elif kind not in ("Cast", "Identity"):
                raise ValueError(f"operator {kind} at {output}; convolutions, leaky ReLUs and sums are expected")
            values[output] = x
        return cast(Tensor, values[self.exit])


def attributes(node: Any) -> dict[str, Any]:
    """What torch's function of the same name is called with."""
    given = {one.name: onnx.helper.get_attribute_value(one) for one in node.attribute}
    if node.op_type == "LeakyRelu":
        return {"negative_slope": given["alpha"]}
    if not node.op_type.startswith("Conv"):
        return {}
    return {"stride": given["strides"], "padding": given.get("pads", [0])[0], "groups": given.get("group", 1)}


def worst_difference(generator: Generator, path: Path, seed: int) -> float:
    """Largest difference from ONNX Runtime on random colours with a square hole, in grey levels."""
    planes = np.random.default_rng(seed).random((1, 4, NETWORK_SIDE, NETWORK_SIDE), np.float32)
    planes[:, 3] = 0
    planes[:, 3, 100:300, 150:400] = 1
    planes[:, :3] *= 1 - planes[:, 3:]
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.log_severity_level = torch.get_num_threads(), 3
    session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    wanted = session.run(None, {generator.entrance: planes})[0]
    with torch.no_grad():
        found = generator(torch.from_numpy(planes), torch.rand(1, len(FURTHER), NETWORK_SIDE, NETWORK_SIDE))
    return float(np.abs(found.numpy() - wanted).max() * 255)


class Example(NamedTuple):
    """A crop for the generator, planes x S x S in 0..1; or a batch of them."""

    planes: Tensor
    further: Tensor
    start: Tensor
    """Colours with cracks as diffused."""
    hole: Tensor
    """1 where the generator fills."""
    truth: Tensor


def color_hole(crop: GuessCrop) -> BoolArray:
    return np.asarray(crop.context[-2] > 0)


def example(crop: GuessCrop, names: Sequence[str]) -> Example:
    """Cracks are closed by diffusion first, as filler `migan` does."""
    at, open_ = names.index("layered"), color_hole(crop)
    start = np.where(open_, crop.color[names.index("telea")], crop.true_color) / np.float32(255)
    hole = (open_ & ~find_cracks(open_))[None].astype(np.float32)
    depths = crop.depth[[1 + at, 0]] / np.float32(LEVELS)
    further = np.concatenate([crop.color[at] / np.float32(255), depths, crop.context[4:7] / np.float32(255)])
    planes = np.concatenate([start * (1 - hole), hole])
    return Example(*map(torch.from_numpy, (planes, further, start, hole, crop.true_color / np.float32(255))))


def batches(folder: Path, size: int, rng: np.random.Generator) -> Iterator[Example]:
    """Batches without end of crops with a colour hole, half of them mirrored."""
    names, paths, found = (folder / INDEX).read_text("utf-8").split(), sorted(folder.glob("*.npz")), []
    while True:
        one = example(read_crop(paths[int(rng.integers(len(paths)))]), names)
        if one.hole.mean() < LEAST_HOLE:
            continue
        found.append(Example(*(plane.flip(-1) for plane in one)) if rng.random() < 0.5 else one)
        if len(found) == size:
            yield Example(*map(torch.stack, zip(*found)))
            found = []


def trained(generator: Generator, asked: argparse.Namespace) -> Iterator[tuple[float, int, np.ndarray]]:
    """Trains for asked.minutes in asked.looks parts; after each the minutes, steps and mean losses (L1, LPIPS) of the part."""
    new = list(generator.further.parameters())
    groups = [{"params": list(generator.constants.parameters())}, {"params": new, "lr": FASTER * asked.rate}]
    optimizer, perceptual = torch.optim.Adam(groups, asked.rate), LpipsLoss()
    source = batches(asked.folder / "train", asked.batch, np.random.default_rng(asked.seed))
    steps = 0
    for look in range(asked.looks):
        started, losses = time.monotonic(), []
        while time.monotonic() - started < 60 * asked.minutes / asked.looks:
            batch = next(source)
            out = generator(batch.planes, None if asked.without_planes else batch.further)
            off = ((out - batch.truth).abs() * batch.hole).sum() / (3 * batch.hole.sum())
            shown = torch.where(batch.hole > 0, out, batch.truth)
            distance = perceptual(shown, batch.truth) / batch.hole.mean()
            optimizer.zero_grad()
            (off + asked.perceptual * distance).backward()
            optimizer.step()
            losses.append((off.item(), distance.item()))
            steps += 1
        yield asked.minutes * (look + 1) / asked.looks, steps, np.mean(losses, 0)


def filled(generator: Generator, names: Sequence[str], with_planes: bool) -> Fill:
    """What the generator as it is now makes of crops."""

    def fill(crop: GuessCrop) -> UInt8Array:
        one = Example(*(plane[None] for plane in example(crop, names)))
        with torch.no_grad():
            out = generator(one.planes, one.further if with_planes else None)
        color = torch.where(one.hole > 0, out.clamp(0, 1), one.start)[0]
        return np.ascontiguousarray(np.round(color.numpy() * 255).astype(np.uint8).transpose(1, 2, 0))

    return fill


def guessed(number: int) -> Fill:
    """A guess of the crops."""
    return lambda crop: np.ascontiguousarray(crop.color[number].transpose(1, 2, 0))


def errors(fill: Fill, crops: Sequence[GuessCrop], lpips: Lpips) -> np.ndarray:
    """Crops x 3: L1, squared error, LPIPS in the hole."""
    truths = [np.ascontiguousarray(crop.true_color.transpose(1, 2, 0)) for crop in crops]
    return np.array([color_errors(fill(crop), true, color_hole(crop), lpips) for crop, true in zip(crops, truths)])


def line(name: str, found: np.ndarray, reference: np.ndarray) -> str:
    """A row of the table, of crops x 3 errors and those of MI-GAN."""
    by = found[:, 2] - reference[:, 2]
    off = f"{by.mean():+8.4f} +- {by.std(ddof=1) / len(by) ** 0.5:.4f}" if by.any() else ""
    return f"{name:32} " + " ".join(f"{value:7.4f}" for value in found.mean(0)) + off


def write_sheet(path: Path, crops: Sequence[GuessCrop], fills: Sequence[Fill]) -> None:
    """A row a crop: known, the fills, truth."""
    rows = []
    for number in np.linspace(0, len(crops) - 1, SHOWN).round().astype(int):
        crop = crops[number]
        hole, truth = color_hole(crop)[..., None], crop.true_color.transpose(1, 2, 0)
        rows.append(np.hstack([truth * ~hole, *(np.where(hole, fill(crop), truth) for fill in fills), truth]))
    cv2.imwrite(str(path), np.vstack(rows)[..., ::-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--minutes", type=float, default=12, help="of training; measuring comes on top")
    parser.add_argument("--looks", type=int, default=3, help="how often it is measured on the way")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--batch", type=int, default=2)
    parser.add_argument("--rate", type=float, default=1e-4, help="learning rate of Adam")
    parser.add_argument("--perceptual", type=float, default=0.3, help="weight of LPIPS; that of L1 is 1")
    parser.add_argument("--without-planes", action="store_true", help="MI-GAN's own planes only")
    parser.add_argument("--sheet", type=Path)
    asked = parser.parse_args()
    torch.manual_seed(asked.seed)
    generator, lpips, folder = Generator(SHIPPED), Lpips(), asked.folder / "held_out"
    worst = worst_difference(generator, SHIPPED, asked.seed)
    print(f"largest difference from ONNX Runtime at {NETWORK_SIDE} x {NETWORK_SIDE}: {worst:.4f} levels")
    names = (folder / INDEX).read_text("utf-8").split()
    crops = [crop for crop in map(read_crop, sorted(folder.glob("*.npz"))) if color_hole(crop).mean() >= LEAST_HOLE]
    layered, shipped = (guessed(names.index(name)) for name in ("layered", "migan"))
    tuned = filled(generator, names, not asked.without_planes)
    reference = errors(tuned, crops, lpips)
    print(f"{len(crops)} held-out crops{'':14}     L1     MSE   LPIPS  LPIPS against MI-GAN alone", flush=True)
    for name, fill in (("layered", layered), ("MI-GAN as filler (the guess)", shipped)):
        print(line(name, errors(fill, crops, lpips), reference))
    print(line("MI-GAN alone, on the crop", reference, reference), flush=True)
    for minutes, steps, losses in trained(generator, asked):
        name, tail = f"{minutes:.1f} min, {steps} steps", "  (training: {:.4f}, {:.4f})".format(*losses)
        print(line(name, errors(tuned, crops, lpips), reference) + tail, flush=True)
    if asked.sheet is not None:
        write_sheet(asked.sheet, crops, (layered, shipped, tuned))


if __name__ == "__main__":
    main()
