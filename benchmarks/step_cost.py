"""Presets in -> what one training step costs per sample, counted while it runs once on the CPU: FLOP by part, and bytes.

    python benchmarks/step_cost.py [--presets small-rgbd small-stereo big-rgbd] [--trunk WEIGHTS]

FLOP are by the formulas of torch.utils.flop_counter: convolutions and matrix products, forward and backward, a multiply-add
as two. They miss the Fourier transforms (added from `training.flops`), norms, activations and losses (about 1 %). Bytes are
what all operations read and write one after another, as PyTorch runs them uncompiled under bf16 autocast: what the memory
has to carry at least.
`closed form` is `training.flops.step_flop`, which `dlama train presets` reckons with.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves
from torch.utils.flop_counter import flop_registry

from dlama.training.data.batches import Batch, keys_of
from dlama.training.flops import fourier_flop, step_flop
from dlama.training.loop.module import TrainingModule
from dlama.training.losses.terms import GENERATOR_TERMS, LossInputs, discriminator_terms, generator_terms
from dlama.training.presets import PRESETS
from dlama.training.settings import TrainSettings

PARTS = ("generator", "perceptual", "adversarial", "discriminator", "penalty")
"""The generator forward and back with the pixel terms; the trunk at truth and output, and back to the output; the discriminator
at truth and output, and back to the output; its own step without R1; what R1 adds to that, over the steps it is skipped in."""


OF_NETWORKS = ("perceptual", "adversarial", "feature_matching")
"""Terms of the generator that need another network."""


class Cost(TorchDispatchMode):
    """Adds up FLOP, by torch's own formulas, and the bytes of every operation's tensors; views move none.

    (FlopCounterMode itself hooks into modules, which R1's gradient of a gradient does not suffer.)
    """

    def __init__(self) -> None:
        super().__init__()
        self.flop, self.bytes = 0.0, 0.0

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = kwargs or {}
        out = func(*args, **kwargs)
        if func.overloadpacket in flop_registry:
            self.flop += flop_registry[func.overloadpacket](*args, **kwargs, out_val=out)
        if not func.is_view:
            self.bytes += sum(each.nbytes for each in tree_leaves((args, kwargs, out)) if isinstance(each, Tensor))
        return out


@contextmanager
def counted(found: dict[str, tuple[float, float]], part: str) -> Iterator[None]:
    """FLOP and bytes of what runs inside, under a name."""
    with Cost() as cost, torch.autocast("cpu", torch.bfloat16):
        yield
    found[part] = cost.flop, cost.bytes


def made_up(settings: TrainSettings, count: int) -> Batch:
    """Noise with a box as its hole."""
    size = settings.data.size
    batch = {key: torch.rand(count, planes, size, size) for key, planes in keys_of(settings.network).items()}
    batch["mask"].zero_()[..., size // 4 : size // 2, size // 4 : size // 2] = 1
    batch["input"][:, -settings.network.masks :] = batch["mask"]
    return batch  # type: ignore[return-value]


def step_cost(settings: TrainSettings, count: int = 1) -> dict[str, tuple[float, float]]:
    """Part -> FLOP (without transforms) and bytes of one sample of one step, as `TrainingModule.training_step` runs it."""
    module, batch, found = TrainingModule(settings), made_up(settings, count), dict[str, tuple[float, float]]()
    module.train()
    loss, discriminator = settings.loss, module.discriminator
    assert discriminator is not None and module.perceptual is not None

    def back(terms: dict[str, Tensor]) -> None:
        torch.stack([term.float() for term in terms.values()]).sum().backward()

    def only(output: Tensor, *names: str) -> dict[str, Tensor]:
        weights = replace(loss, **{name: 0.0 for name in GENERATOR_TERMS if name not in names})
        return generator_terms(LossInputs(output, batch, settings.network, weights, module.perceptual, discriminator))

    with counted(found, "generator"):
        output = module(batch["input"])
        back(only(output, *(name for name in GENERATOR_TERMS if name not in OF_NETWORKS)))
    leaf = output.detach().requires_grad_()
    with counted(found, "perceptual"):
        back(only(leaf, "perceptual"))
    discriminator.requires_grad_(False)
    with counted(found, "adversarial"):
        back(only(leaf, "adversarial", "feature_matching"))
    discriminator.requires_grad_(True)
    for part, strength in (("discriminator", 0.0), ("penalty", loss.gradient_penalty)):
        with counted(found, part):
            back(discriminator_terms(discriminator, leaf, batch, loss, strength))
    extra = [(one - other) / loss.penalty_every for one, other in zip(found["penalty"], found["discriminator"])]
    found["penalty"] = extra[0], extra[1]
    return {part: (flop / count, moved / count) for part, (flop, moved) in found.items()}


def line(name: str, cells: list[str], write: Callable[[str], None] = print) -> None:
    """One row."""
    write(f"{name:14}" + "".join(f"{cell:>15}" for cell in cells))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--presets", nargs="+", choices=list(PRESETS), default=["small-rgbd", "small-stereo", "big-rgbd"]
    )
    parser.add_argument("--trunk", type=Path, help="weights of the perceptual trunk (default: the random one)")
    chosen = parser.parse_args()
    print("GFLOP per sample and training step; GB that it moves")
    line("", [*PARTS, "transforms", "all", "closed form", "GB moved"])
    for name in chosen.presets:
        settings = PRESETS[name].settings
        if chosen.trunk:
            settings = replace(settings, loss=replace(settings.loss, trunk="auto", trunk_weights=str(chosen.trunk)))
        found, fourier = step_cost(settings), fourier_flop(settings)
        total = sum(flop for flop, _ in found.values()) + fourier
        formula = f"{step_flop(settings) / 1e9:.1f}" if chosen.trunk is None else "-"
        cells = [f"{found[part][0] / 1e9:.1f}" for part in PARTS] + [
            f"{fourier / 1e9:.2f}",
            f"{total / 1e9:.1f}",
            formula,
        ]
        line(name, [*cells, f"{sum(moved for _, moved in found.values()) / 1e9:.2f}"])


if __name__ == "__main__":
    main()
