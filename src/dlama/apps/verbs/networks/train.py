"""`dlama train`: settings or a preset in, a run directory out."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional

from dlama.apps.options import Report, option
from dlama.apps.places import check_folder_apart
from dlama.apps.terminal.output import KERNELS, report_result
from dlama.apps.terminal.streams import print_line
from dlama.errors import InputError, require_extra
from dlama.workers.progress import log_messages

LIST = "presets"
NEEDED = {"torch": "torch", "pytorch-lightning": "pytorch_lightning", "onnx": "onnx"}

Number = Annotated[int | None, option("N", "the settings'")]


@dataclass(frozen=True)
class Replaced:
    """Values in place of those of the settings."""

    start: Annotated[Path | None, option("FILE", "the settings'")] = None
    """A LaMa checkpoint to start from; planes it lacks are added."""
    mixture: Annotated[tuple[str, ...], option("KIND=SHARE ...", "the settings'")] = ()
    """Kinds of samples and their shares: world, frame (posed pairs of --data), removal, stereo."""
    steps: Number = None
    """Batches until the end."""
    batch: Number = None
    """Samples of a batch, on each device."""
    precision: Annotated[Literal["bf16", "fp32"] | None, option("bf16|fp32", "the settings'")] = None
    """bf16 is faster on GPUs, and on CPUs that have it (lscpu says avx512_bf16 or amx_bf16)."""
    devices: Number = None
    """GPUs, or processes on a CPU."""


def train(
    settings: Positional[Annotated[str, option("SETTINGS.json|PRESET", None)]],
    /,
    replaced: Replaced,
    report: Report,
    output: Annotated[Path | None, option("DIR", None, aliases=["-o"])] = None,
    data: Annotated[tuple[Path, ...], option("PATH ...", "procedural worlds")] = (),
    max_minutes: Annotated[float | None, option("MINUTES", "until the last step")] = None,
    resume: Annotated[bool, option("", "a new run")] = False,
) -> None:
    """Train a network that fills colour and depth, or both pictures of a stereo pair, together.

    Args:
        settings: A settings file or a preset; `presets` lists them.
        output: Directory of the run: settings, metrics, sheets, checkpoint, and at the end the network.
        data: Folders of pictures or data sets (posed pairs, frames with and without an object, stereo pairs) that
            samples are made of.
        max_minutes: Stop after so long, with a checkpoint and the network as it is then.
        resume: Continue the run in this directory, exactly as if it had never stopped, with its own data and options.
    """
    from dlama.training.loop.run_files import choose_settings
    from dlama.training.presets import preset_lines

    if settings == LIST:
        print("\n".join(preset_lines()))
        return
    if output is None:
        raise InputError("no directory of the run is given: give -o DIR")
    check_folder_apart(
        output, {f"data {path}": path for path in data} | {"settings": settings, "start": replaced.start}
    )
    chosen = choose_settings(settings, run=output if resume else None, **vars(replaced))
    require_extra("training a network", "train", NEEDED)
    from dlama.training.loop import train as loop

    logged = nullcontext() if report.quiet else log_messages(partial(print_line, "note"), without=KERNELS)
    with report_result("train", report) as result, logged:
        done = loop.train(chosen, output, data=data, max_minutes=max_minutes, resume=resume)
        if done.first:
            network = None if done.network is None else str(done.network)
            line = f"{done.run}: step {done.step}, {done.ended}; {network or 'no network yet, --resume continues'}"
            result.add(line, output=str(done.run), step=done.step, ended=done.ended, network=network)
