"""`dlama train` and `dlama pack`: settings or a preset in, a run directory out; pictures and data sets in, one file out."""

from __future__ import annotations

import importlib
import importlib.util
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional

from dlama.apps.options import told
from dlama.errors import InputError, MissingExtraError
from dlama.training.settings import TrainSettings

LIST = "presets"
EXAMPLES: dict[str, tuple[str, ...]] = {
    "train": (
        "dlama train presets",
        "dlama train tiny -o run",
        "dlama train small-rgbd --data pack.dlama --max-minutes 40 -o run",
        "dlama train small-rgbd --resume -o run",
        "dlama train my-settings.json --start big-lama.ckpt --data photos/ rooms/ -o run",
    ),
    "pack": ("dlama pack photos/ rooms/ -o pack.dlama --megabytes 45",),
}
"""For `dlama VERB --help`."""

Number = Annotated[int | None, told("N", "(default: the settings')")]
Weights = Annotated[Path | None, told("FILE", "(default: the settings')")]
Data = Annotated[tuple[Path, ...], told("PATH ...", "(default: procedural worlds)")]


def train(
    settings: Positional[Annotated[str, told("SETTINGS.json|PRESET")]],
    /,
    output: Annotated[Path | None, told("DIR", "(required)", aliases=["-o"])] = None,
    data: Data = (),
    max_minutes: Annotated[float | None, told("MINUTES", "(default: until the last step)")] = None,
    resume: bool = False,
    start: Weights = None,
    trunk: Weights = None,
    steps: Number = None,
    batch: Number = None,
    precision: Annotated[Literal["bf16", "fp32"] | None, told("bf16|fp32", "(default: the settings')")] = None,
    devices: Number = None,
) -> None:
    """Train a network that fills colour and depth, or both pictures of a stereo pair, together.

    Args:
        settings: A settings file or a preset; `presets` lists them.
        output: Directory of the run: settings, metrics, sheets, checkpoint, and at the end the network.
        data: Folders of pictures, data sets (posed pairs, frames with and without a thing, stereo pairs) or packs that
            samples are made of.
        max_minutes: Stop after so long, with a checkpoint and the network as it is then.
        resume: Go on with the run in this directory, exactly as if it had never stopped.
        start: A LaMa checkpoint to start from; planes it lacks are added.
        trunk: Weights of the perceptual trunk: dilated ResNet-50, VGG-16 or AlexNet (.safetensors, .pth).
        steps: Batches until the end.
        batch: Samples of a batch, on each device.
        precision: bf16 is faster on GPUs, and on CPUs that have it (lscpu says avx512_bf16 or amx_bf16).
        devices: GPUs, or processes on a CPU.
    """
    if settings == LIST:
        print("\n".join(preset_lines()))
        return
    if output is None:
        raise InputError("nothing says where the run goes: give -o DIR")
    if max_minutes is not None and not max_minutes > 0:
        raise InputError(f"--max-minutes is {max_minutes}; more than 0 is wanted")
    chosen = chosen_settings(settings, start, trunk, steps=steps, batch=batch, precision=precision, devices=devices)
    require_training()
    from dlama.training.loop import train as loop

    with spoken():
        done = loop.train(chosen, output, data=data, max_minutes=max_minutes, resume=resume)
    if done.first:
        print(f"{done.run}: step {done.step}, {done.ended}; {done.network or 'no network yet, --resume goes on'}")


def pack(
    data: Positional[Annotated[tuple[Path, ...], told("PATH ...")]],
    /,
    output: Annotated[Path, told("FILE", "(required)", aliases=["-o"])],
    megabytes: Annotated[float, told("MB", "(default: 45)")] = 45.0,
    size: Annotated[int, told("PX", "(default: 256)")] = 256,
    seed: Annotated[int, told("N", "(default: 0)")] = 0,
) -> None:
    """Pack pictures and data sets into one file of a stated size that trains anywhere with no other file.

    Args:
        data: Folders of pictures and of data sets.
        output: The file that is written.
        megabytes: Its size at most, in millions of bytes.
        size: Height and width of the packed pictures in pixels.
        seed: Which pictures are taken where not all fit.
    """
    packing = importlib.import_module("dlama.training.data.pack")  # needs what it packs with only now
    print("\n".join(packing.pack(data, output, megabytes=megabytes, size=size, seed=seed)))


def chosen_settings(name: str, start: Path | None, trunk: Path | None, **loop: Any) -> TrainSettings:
    """A file's or a preset's settings with what the command line says put in; InputError."""
    from dlama.training.settings_files import settings_of

    found = settings_of(name)
    if start is not None:
        found = replace(found, network=replace(found.network, start=str(start)))
    if trunk is not None:
        found = replace(found, loss=replace(found.loss, trunk="auto", trunk_weights=str(trunk)))
    changes = {key: value for key, value in loop.items() if value is not None}
    return replace(found, loop=replace(found.loop, **changes))


def preset_lines() -> list[str]:
    """What each preset is for, and what it costs."""
    from dlama.training.flops import budget
    from dlama.training.presets import PRESETS

    lines = []
    for name, preset in PRESETS.items():
        s = preset.settings
        lines += [f"{name}: {preset.what}"]
        lines += [f"    {budget(s, 512)}"]
        lines += [
            f"    {s.loop.steps} steps of {s.loop.batch} samples of {s.data.size} x {s.data.size} pixels, {s.loop.precision}",
            f"    samples/s: {preset.samples_per_second}",
        ]
    return lines


def require_training() -> None:
    """MissingExtraError naming the first package that training lacks."""
    for package, name in (("torch", "torch"), ("pytorch_lightning", "pytorch-lightning"), ("onnx", "onnx")):
        if importlib.util.find_spec(package) is None:
            raise MissingExtraError("training a network", name, "train")


@contextmanager
def spoken() -> Iterator[None]:
    """What the training logs, on standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(message)s"))
    log = logging.getLogger("dlama")
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
