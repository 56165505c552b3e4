"""A preset's name or a settings file in -> settings out, and settings in -> JSON out; needs no torch.

Reading is strict: an unknown name or a value of another type is refused; a setting that a file leaves out keeps its default.
"""

from __future__ import annotations

import json
import typing
from dataclasses import asdict, dataclass, is_dataclass
from pathlib import Path
from typing import Any

from dlama.arguments import check
from dlama.errors import FileError, InputError, system_errors
from dlama.files.fields import json_text, json_value
from dlama.training.kinds import Planes
from dlama.training.settings import (
    DataSettings,
    LoopSettings,
    LossSettings,
    NetworkSettings,
    OptimiserSettings,
    TrainSettings,
)


@dataclass(frozen=True)
class Preset:
    """Named settings."""

    purpose: str
    """One line for people."""
    settings: TrainSettings
    samples_per_second: str
    """Expected training speed: measured, or an estimate that says how it was made."""


MINI = (
    "3 per core in fp32, 5 in bf16 (measured: one EPYC core with AVX-512 bf16; a core for making samples comes on top)"
)
SMALL = "about 255 (estimate: what 15 cores make, 17 each; by its FLOP a GPU of 990 TFLOP/s does three times as many)"
BIG = "about 60 (estimate: 1.7 TFLOP a sample and step, 10 % of a GPU of 990 TFLOP/s; 15 cores make 64)"
FINISH = OptimiserSettings(warm_up=200, decay="cosine")


def _tiny() -> TrainSettings:
    network = NetworkSettings("rgbd", width=8, blocks=1, downsamplings=2, discriminator_width=8, discriminator_layers=2)
    loop = LoopSettings(40, 4, accelerator="cpu", log_every=5, validate_every=20, sheet_every=20, checkpoint_every=20)
    return TrainSettings(
        "tiny",
        network=network,
        loss=LossSettings(trunk_width=8),
        optimiser=OptimiserSettings(average=0.9),
        data=DataSettings(size=64, held_out=4, workers=0),
        loop=loop,
    )


def _mini(planes: Planes, kind: str) -> TrainSettings:
    loop = LoopSettings(1000, 8, accelerator="cpu", validate_every=100, sheet_every=200, checkpoint_every=200)
    return TrainSettings(
        f"mini-{planes}",
        network=NetworkSettings(planes, width=16, blocks=4, discriminator_width=16, discriminator_layers=3),
        loss=LossSettings(trunk_width=16, penalty_every=4),
        optimiser=OptimiserSettings(warm_up=50, decay="cosine", average=0.99),
        data=DataSettings(size=256, mixture={kind: 1.0}, held_out=16),
        loop=loop,
    )


def _small(planes: Planes, kind: str) -> TrainSettings:
    return TrainSettings(
        f"small-{planes}",
        network=NetworkSettings(planes),
        loss=LossSettings(penalty_every=4),
        optimiser=FINISH,
        data=DataSettings(size=256, mixture={kind: 1.0}, held_out=32),
        loop=LoopSettings(steps=20_000, batch=32, precision="bf16"),
    )


def _big() -> TrainSettings:
    return TrainSettings(
        "big-rgbd",
        network=NetworkSettings("rgbd", width=64, blocks=18),
        optimiser=FINISH,
        data=DataSettings(size=512, held_out=32),
        loop=LoopSettings(steps=300_000, batch=8, precision="bf16"),
    )


PRESETS: dict[str, Preset] = {
    "tiny": Preset("one minute on a CPU: does the whole loop work?", _tiny(), "60 on one EPYC core"),
    "mini-rgbd": Preset("colour and depth, on a CPU", _mini("rgbd", "world"), MINI),
    "mini-stereo": Preset("both pictures of a pair, on a CPU", _mini("stereo", "stereo"), MINI),
    "small-rgbd": Preset("colour and depth, on one GPU", _small("rgbd", "world"), SMALL),
    "small-stereo": Preset("both pictures of a pair, on one GPU", _small("stereo", "stereo"), SMALL),
    "big-rgbd": Preset("colour and depth in big-lama's shape; start from its weights", _big(), BIG),
}
"""By name, in the order of their size."""


def preset_lines() -> list[str]:
    """What each preset is for, and what it costs."""
    lines = []
    for name, preset in PRESETS.items():
        s = preset.settings
        lines += [f"{name}: {preset.purpose}"]
        lines += [
            f"    {s.network.parameters / 1e6:.2f} M parameters",
            f"    {s.loop.steps} steps of {s.loop.batch} samples of {s.data.size} x {s.data.size} pixels, {s.loop.precision}",
            f"    samples/s: {preset.samples_per_second}",
        ]
    return lines


def to_json(settings: TrainSettings) -> str:
    """The text of a settings file, every setting written out."""
    return json.dumps(asdict(settings), indent=2) + "\n"


def from_json(text: str, file: str = "settings") -> TrainSettings:
    """Settings of such a text; `file` is its name in messages. FileError naming the first wrong field."""
    value = json_value(file, text)
    try:
        return typing.cast(TrainSettings, _dataclass_of(TrainSettings, value, ""))
    except (InputError, OverflowError) as error:
        raise FileError(f"{file}: {error}") from error


@system_errors(FileError)
def settings_of(name_or_file: str | Path) -> TrainSettings:
    """A preset by its name, or the settings of a JSON file.

    Raises InputError, which lists the presets, where it is neither; FileError as `from_json`.
    """
    if str(name_or_file) in PRESETS:
        return PRESETS[str(name_or_file)].settings
    path = Path(name_or_file)
    if not path.is_file():
        raise InputError(f"{name_or_file}: neither a settings file nor one of the presets {', '.join(PRESETS)}")
    return from_json(json_text(path), str(path))


def _dataclass_of(kind: type, value: Any, at: str) -> Any:
    """An instance of a settings class from a JSON object; at: the path of the object, with a dot, for messages."""
    if not isinstance(value, dict):
        raise InputError(f"{at.rstrip('.') or 'the file'} is {value!r}; a table is expected")
    hints = typing.get_type_hints(kind)
    unknown = [name for name in value if name not in hints]
    if unknown:
        raise InputError(f"{at}{unknown[0]} is no setting; the known ones are {', '.join(hints)}")
    found: dict[str, Any] = {}
    for name, item in value.items():
        if is_dataclass(hints[name]):
            found[name] = _dataclass_of(hints[name], item, f"{at}{name}.")
        else:
            check(item, hints[name], f"{at}{name}")
            if hints[name] is int and type(item) is not int:
                raise InputError(f"{at}{name} is {item!r}; a whole number is expected")
            found[name] = float(item) if hints[name] is float else item
    return kind(**found)
