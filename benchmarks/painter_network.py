"""MI-GAN's generator as a torch module, the discriminator that learns next to it, and a step of both.

The loss is of the picture with its hole filled: LPIPS, the mean absolute difference, features of the discriminator and its
judgement. LPIPS is taken on pictures moved and resized at random, or the network learns the grid of its first layer by heart.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.nn import functional

from dlama.training.losses.perceptual import LpipsLoss
from dlama.writing.atomic_write import write_file

RATE, DISCRIMINATOR_RATE, AVERAGED = 1e-4, 2e-4, 0.998
ABSOLUTE, PERCEPTUAL, FEATURES, JUDGEMENT = 0.3, 0.5, 1.0, 0.05
"""Weights of the generator's loss."""
PENALTY, PENALTY_EVERY = 0.01, 8
"""Weight of the squared gradient of the discriminator (R1), and every so many steps."""
ALONE, RISING = 100, 300
"""Steps in which the discriminator learns alone, and in which its weight rises then."""
WIDTH, SHIFT, SCALES = 32, 8, (1, 1, 0.8, 1.25)


class Generator(nn.Module):
    """The graph of a file of `migan_export`, its constants as parameters in single precision; noise is not learnt."""

    def __init__(self, path: Path) -> None:
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
        self.learnt = nn.ParameterDict()
        for name in sorted((weights | noise) & set(constants)):  # an order that optimizers keep
            tensor = torch.from_numpy(constants[name].astype(np.float32))
            self.learnt[name] = nn.Parameter(tensor, requires_grad=name in weights)
        self.entrance, self.exit = graph.input[0].name, graph.output[0].name

    def forward(self, planes: Tensor) -> Tensor:
        """B x 4 x H x W (colours, 0 in the hole; 1 = fill) -> B x 3 x H x W, unbounded."""
        values: dict[str, Any] = {self.entrance: planes, **self.learnt}
        hw = planes.shape[2:]
        for kind, inputs, output, about in self.nodes:
            x = values.get(inputs[0])
            if kind == "Conv":
                pads = about.get("pads", [0, 0])
                rest = [values[name] for name in inputs[1:]]
                x = functional.conv2d(x, *rest, stride=about["strides"], padding=pads[:2], groups=about.get("group", 1))
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

    def fill(self, color: Tensor, hole: Tensor) -> Tensor:
        """B x 3 x H x W of colours (0..1) and a hole (B x 1 x H x W, 1 = fill): what it paints, everywhere."""
        return self(torch.cat([color * (1 - hole), hole], 1))

    def write(self, start: Path, path: Path) -> None:
        """The file of `start` with these weights, in its precision."""
        model = onnx.load(start)
        for one in model.graph.initializer:
            if one.name in self.learnt:
                array = self.learnt[one.name].detach().numpy().astype(numpy_helper.to_array(one).dtype)
                one.CopyFrom(numpy_helper.from_array(array, one.name))
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

    def __init__(self, start: Path) -> None:
        self.generator, self.discriminator = Generator(start), PatchDiscriminator()
        for network in (self.generator, self.discriminator):
            network.to(memory_format=torch.channels_last)
        self.averaged = copy.deepcopy(self.generator).requires_grad_(False)
        learnt = [one for one in self.generator.parameters() if one.requires_grad]
        self.optimizer = torch.optim.Adam(learnt, RATE, (0.8, 0.99))
        self.opponent = torch.optim.Adam(self.discriminator.parameters(), DISCRIMINATOR_RATE, (0.5, 0.99))
        self.perceptual, self.step = LpipsLoss(), 0
        self.parts = {
            "generator": self.generator, "discriminator": self.discriminator, "averaged": self.averaged,
            "optimizer": self.optimizer, "opponent": self.opponent,
        }  # fmt: skip

    def save(self, path: Path) -> None:
        """All that training goes on from."""
        torch.save({"step": self.step, **{name: part.state_dict() for name, part in self.parts.items()}}, path)

    def load(self, path: Path) -> None:
        """Goes on from there."""
        state = torch.load(path, weights_only=True)
        self.step = state["step"]
        for name, part in self.parts.items():
            part.load_state_dict(state[name])

    def learn(self, batch: tuple[Tensor, Tensor, Tensor, Tensor], rng: np.random.Generator) -> list[float]:
        """One step of both networks; the absolute difference, LPIPS and both judgements."""
        color, truth, hole, counted = batch
        painted = self.generator.fill(color, hole)
        filled = torch.where(counted > 0, painted, truth)
        share = counted.mean()
        absolute = ((painted - truth).abs() * counted).sum() / (3 * counted.sum())
        distance = self.perceptual(*moved_alike((filled, truth), rng)) / share
        loss = ABSOLUTE * absolute + PERCEPTUAL * distance
        weight = min(1.0, max(0.0, (self.step - ALONE) / RISING))
        judged = torch.zeros(())
        if weight:
            with torch.no_grad():
                _, real_features = self.discriminator(truth, counted)
            scores, features = self.discriminator(filled, counted)
            judged = mean_in(functional.softplus(-scores), counted)
            off = [(one - other).abs().mean() for one, other in zip(features, real_features)]
            loss = loss + weight * (JUDGEMENT * judged + FEATURES * torch.stack(off).mean() / share)
        self.optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(self.generator.parameters(), 1.0)
        self.optimizer.step()
        opposed = self._learn_to_tell(truth, filled.detach(), counted)
        kept = min(AVERAGED, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            for mean, now in zip(self.averaged.parameters(), self.generator.parameters()):
                mean.lerp_(now, 1 - kept)
        self.step += 1
        return [absolute.item(), distance.item(), judged.item(), opposed]

    def _learn_to_tell(self, truth: Tensor, filled: Tensor, hole: Tensor) -> float:
        """A step of the discriminator; its loss, 2 log 2 where it cannot tell the two apart."""
        penalised = self.step % PENALTY_EVERY == 0
        truth = truth.detach().requires_grad_(penalised)
        real, _ = self.discriminator(truth, hole)
        fake, _ = self.discriminator(filled, hole)
        loss = mean_in(functional.softplus(-real), hole) + mean_in(functional.softplus(fake), hole)
        found = loss.item()
        if penalised:
            (slope,) = torch.autograd.grad((real * in_scores(hole, real)).sum(), truth, create_graph=True)
            strength = PENALTY * PENALTY_EVERY
            loss = loss + strength * slope.square().sum((1, 2, 3)).mean() / in_scores(hole, real).sum((1, 2, 3)).mean()
        self.opponent.zero_grad()
        loss.backward()
        self.opponent.step()
        return found


def in_scores(hole: Tensor, scores: Tensor) -> Tensor:
    """The hole at the size of the discriminator's scores."""
    return functional.interpolate(functional.max_pool2d(hole, 8), scores.shape[-2:])


def mean_in(values: Tensor, hole: Tensor) -> Tensor:
    """Mean over the scores of the hole."""
    inside = in_scores(hole, values)
    return (values * inside).sum() / inside.sum()


def moved_alike(pictures: Sequence[Tensor], rng: np.random.Generator) -> list[Tensor]:
    """Pictures cut by the same few pixels and resized by the same factor."""
    down, right = rng.integers(0, SHIFT, 2)
    by = float(rng.choice(SCALES))
    cut = [one[..., down:, right:] for one in pictures]
    if by != 1:
        cut = [functional.interpolate(one, scale_factor=by, mode="bilinear", antialias=True) for one in cut]
    return cut
