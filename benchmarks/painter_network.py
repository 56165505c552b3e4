"""MI-GAN's generator as a torch module, the discriminator that learns next to it, and a step of both.

The loss is of the picture with its hole filled: LPIPS, the mean absolute and squared difference, features of the discriminator
and its judgement. LPIPS is taken on pictures moved, turned and resized at random, or the network learns the grid of its first
layer by heart.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.nn import functional

from dlama.training.losses.perceptual import LpipsLoss
from dlama.writing.atomic_write import write_file
from painter_data import GUIDES, Batch

RATE, DISCRIMINATOR_RATE, AVERAGED = 2e-4, 4e-4, 0.999
PENALTY, PENALTY_EVERY = 0.01, 8
"""Weight of the squared gradient of the discriminator (R1), and every so many steps."""
ALONE, RISING = 200, 500
"""Steps in which the discriminator learns alone, and in which its weight rises then."""
WIDTH, SHIFT, SCALES = 64, 32, (1, 1, 0.8, 1.25, 0.6)
SCORES_OF = 8
"""Pixels that a score of the discriminator stands for, each way."""


class Weights(NamedTuple):
    """Of the terms of the generator's loss."""

    absolute: float = 0.3
    squared: float = 0.0
    perceptual: float = 0.5
    features: float = 1.0
    judgement: float = 0.05


class Generator(nn.Module):
    """The graph of a file of `migan_export`, its constants as parameters in single precision; noise is not learnt.

    guided: with weights of zero for GUIDES more planes, so that it begins as it is.
    """

    def __init__(self, path: Path, guided: bool = False) -> None:
        super().__init__()
        graph = onnx.load(path).graph
        constants = {one.name: numpy_helper.to_array(one) for one in graph.initializer}
        names = {one.output[0]: one.input[0] for one in graph.node if one.op_type == "Cast"}
        self.nodes = [
            (
                one.op_type,
                [names.get(name, name) for name in one.input],
                one.output[0],
                {each.name: onnx.helper.get_attribute_value(each) for each in one.attribute},
            )
            for one in graph.node
            if one.op_type != "Cast"
        ]
        weights = {name for kind, inputs, *_ in self.nodes if kind == "Conv" for name in inputs[1:]}
        noise = {inputs[0] for kind, inputs, *_ in self.nodes if kind == "Slice"}
        self.entrance, self.exit = graph.input[0].name, graph.output[0].name
        first = next(inputs[1] for kind, inputs, *_ in self.nodes if kind == "Conv" and inputs[0] == self.entrance)
        self.learnt = nn.ParameterDict()
        for name in sorted((weights | noise) & set(constants)):  # an order that optimizers keep
            tensor = torch.from_numpy(constants[name].astype(np.float32))
            if guided and name == first:
                tensor = functional.pad(tensor, (0, 0, 0, 0, 0, GUIDES))
            self.learnt[name] = nn.Parameter(tensor, requires_grad=name in weights)
        self.planes = self.learnt[first].shape[1]

    def forward(self, planes: Tensor) -> Tensor:
        """B x planes x H x W (colours, 0 in the hole; 1 = fill; guides) -> B x 3 x H x W, unbounded."""
        values: dict[str, Any] = {self.entrance: planes, **self.learnt}
        hw = planes.shape[2:]
        for kind, inputs, output, about in self.nodes:
            x = values.get(inputs[0])
            if kind == "Conv":
                pads = about.get("pads", [0, 0])
                rest, groups = [values[name] for name in inputs[1:]], about.get("group", 1)
                slow = x.device.type == "cpu" and groups > 1 and about["strides"][0] > 1  # backwards, in half precision
                with torch.autocast("cpu", enabled=torch.is_autocast_enabled("cpu") and not slow):
                    x = x.float() if slow else x
                    x = functional.conv2d(x, *rest, stride=about["strides"], padding=pads[:2], groups=groups)
            elif kind == "LeakyRelu":
                x = functional.leaky_relu(x, about["alpha"])
            elif kind == "Add":
                x = x + values[inputs[1]]
            elif kind == "Resize":
                x = functional.interpolate(x, scale_factor=2, mode="nearest")
            elif kind == "Shape":  # of what noise is added to; the two Slices that follow cut the noise to it
                x, hw = None, x.shape[2:]
            elif kind == "Slice":
                x = None if x is None else x[..., : hw[0], : hw[1]]
            elif kind != "Identity":
                raise ValueError(f"operator {kind} at {output}: a file of migan_export is expected")
            values[output] = x
        return values[self.exit]

    def fill(self, batch: Batch) -> Tensor:
        """B x 3 x H x W: what it paints, everywhere."""
        planes = torch.cat([batch.color * (1 - batch.hole), batch.hole, batch.guides], 1)[:, : self.planes]
        return self(planes.contiguous(memory_format=torch.channels_last))

    def write(self, start: Path, path: Path) -> None:
        """The file of `start` with these weights, in its precision."""
        model = onnx.load(start)
        for one in model.graph.initializer:
            if one.name in self.learnt:
                array = self.learnt[one.name].detach().cpu().numpy().astype(numpy_helper.to_array(one).dtype)
                one.CopyFrom(numpy_helper.from_array(array, one.name))
        model.graph.input[0].type.tensor_type.shape.dim[1].dim_value = self.planes
        write_file(path, model.SerializeToString())


class PatchDiscriminator(nn.Module):
    """Pictures (B x 3 x H x W, 0..1) and their holes -> logits of patches being real, and the activations of each layer."""

    def __init__(self) -> None:
        super().__init__()
        sides = ((4, WIDTH, 2), (WIDTH, 2 * WIDTH, 2), (2 * WIDTH, 4 * WIDTH, 2), (4 * WIDTH, 4 * WIDTH, 1))
        self.layers = nn.ModuleList([nn.Conv2d(before, after, 4, stride, 1) for before, after, stride in sides])
        self.last = nn.Conv2d(4 * WIDTH, 1, 3, padding=1)

    def forward(self, picture: Tensor, hole: Tensor) -> tuple[Tensor, list[Tensor]]:
        """As the class says."""
        x, found = torch.cat([2 * picture - 1, hole], 1), []
        for layer in self.layers:
            x = functional.leaky_relu(layer(x), 0.2)
            found.append(x)
        return self.last(x), found


class Run:
    """What is trained, its losses and state."""

    def __init__(
        self, start: Path, device: torch.device, weights: Weights, guided: bool = False, half: bool = False
    ) -> None:
        """half: bfloat16; a processor with AMX takes two thirds of the time."""
        self.device, self.weights, self.in_half, self.step = device, weights, half, 0
        self.generator, self.discriminator = Generator(start, guided), PatchDiscriminator()
        self.perceptual = LpipsLoss()
        for network in (self.generator, self.discriminator, self.perceptual):
            network.to(device, memory_format=torch.channels_last)
        self.averaged = copy.deepcopy(self.generator).requires_grad_(False)
        self.learnt = [one for one in self.generator.parameters() if one.requires_grad]
        self.optimizer = torch.optim.Adam(self.learnt, RATE, (0.8, 0.99))
        self.opponent = torch.optim.Adam(self.discriminator.parameters(), DISCRIMINATOR_RATE, (0.5, 0.99))
        self.parts = {
            "generator": self.generator, "discriminator": self.discriminator, "averaged": self.averaged,
            "optimizer": self.optimizer, "opponent": self.opponent,
        }  # fmt: skip

    def save(self, path: Path) -> None:
        """All that training continues from."""
        torch.save({"step": self.step, **{name: part.state_dict() for name, part in self.parts.items()}}, path)

    def load(self, path: Path) -> None:
        """Goes on from there."""
        state = torch.load(path, map_location=self.device, weights_only=True)
        self.step = state["step"]
        for name, part in self.parts.items():
            part.load_state_dict(state[name])

    def set_rate(self, factor: float) -> None:
        """The learning rates, in those that training begins with."""
        for optimizer, rate in ((self.optimizer, RATE), (self.opponent, DISCRIMINATOR_RATE)):
            for group in optimizer.param_groups:
                group["lr"] = factor * rate

    def half(self, unless: bool = False) -> torch.autocast:
        """Half precision, where the run has it."""
        return torch.autocast(self.device.type, torch.bfloat16, enabled=self.in_half and not unless)

    def learn(self, batch: Batch, rng: np.random.Generator) -> Tensor:
        """One step of both networks; the absolute difference, LPIPS and both judgements."""
        weights, truth, counted = self.weights, batch.truth, batch.counted
        with self.half():
            painted = self.generator.fill(batch).float()
            filled = torch.where(counted > 0, painted, truth)
            share, total = counted.mean(), 3 * counted.sum()
            absolute = ((painted - truth).abs() * counted).sum() / total
            loss = weights.absolute * absolute
            if weights.squared:
                loss = loss + weights.squared * ((painted - truth).square() * counted).sum() / total
            distance = self.perceptual(*moved_alike((filled, truth), rng)) / share
            loss, judged = loss + weights.perceptual * distance, torch.zeros_like(absolute)
            rising = min(1.0, max(0.0, (self.step - ALONE) / RISING))
            if rising:
                judged, features = self._judgement(filled, truth, counted)
                loss = loss + rising * (weights.judgement * judged + weights.features * features / share)
        self.optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.learnt, 1.0)
        self.optimizer.step()
        opposed = self._learn_to_tell(truth, filled.detach(), counted)
        kept = min(AVERAGED, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            torch._foreach_lerp_(list(self.averaged.parameters()), list(self.generator.parameters()), 1 - kept)
        self.step += 1
        return torch.stack([absolute, distance, judged, opposed]).detach()

    def _judgement(self, filled: Tensor, truth: Tensor, hole: Tensor) -> tuple[Tensor, Tensor]:
        """By how much the discriminator can tell, and the mean difference of its activations."""
        self.discriminator.requires_grad_(False)
        with torch.no_grad():
            _, real = self.discriminator(truth, hole)
        scores, found = self.discriminator(filled, hole)
        self.discriminator.requires_grad_(True)
        off = [(one.float() - other.float()).abs().mean() for one, other in zip(found, real)]
        return mean_in(functional.softplus(-scores.float()), hole), torch.stack(off).mean()

    def _learn_to_tell(self, truth: Tensor, filled: Tensor, hole: Tensor) -> Tensor:
        """A step of the discriminator; its loss, 2 log 2 where it cannot tell the two apart."""
        penalised = self.step % PENALTY_EVERY == 0
        truth = truth.detach().requires_grad_(penalised)
        with self.half(unless=penalised):  # whose second derivatives are slow in half precision
            real, fake = (self.discriminator(picture, hole)[0].float() for picture in (truth, filled))
        loss = found = mean_in(functional.softplus(-real), hole) + mean_in(functional.softplus(fake), hole)
        if penalised:
            inside = in_scores(hole, real)
            (slope,) = torch.autograd.grad((real * inside).sum(), truth, create_graph=True)
            slope = slope.square().sum((1, 2, 3)).mean() / inside.sum((1, 2, 3)).mean()
            loss = loss + PENALTY * PENALTY_EVERY * slope
        self.opponent.zero_grad()
        loss.backward()
        self.opponent.step()
        return found


def in_scores(hole: Tensor, scores: Tensor) -> Tensor:
    """The hole at the size of the discriminator's scores."""
    return functional.interpolate(functional.max_pool2d(hole, SCORES_OF), scores.shape[-2:])


def mean_in(values: Tensor, hole: Tensor) -> Tensor:
    """Mean over the scores of the hole."""
    inside = in_scores(hole, values)
    return (values * inside).sum() / inside.sum()


def moved_alike(pictures: Sequence[Tensor], rng: np.random.Generator) -> list[Tensor]:
    """Pictures cut by the same few pixels, resized by the same factor and turned alike."""
    down, right = rng.integers(0, SHIFT, 2)
    by, turns, mirrored = float(rng.choice(SCALES)), int(rng.integers(4)), rng.random() < 0.5
    found = []
    for one in pictures:
        one = one[..., down:, right:]
        if by != 1:
            one = functional.interpolate(one, scale_factor=by, mode="bilinear", antialias=True)
        one = torch.rot90(one, turns, (2, 3))
        found.append(one.flip(3) if mirrored else one)
    return found
