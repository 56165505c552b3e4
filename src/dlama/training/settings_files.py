"""Settings in -> settings.json out, and back; a preset's name or a file in -> settings out. Needs no torch.

Reading is strict: an unknown name or a value of another kind is refused; what a file leaves out keeps its default.
"""

from __future__ import annotations

import json
import types
import typing
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, Literal

from dlama.errors import FileError, InputError
from dlama.training.presets import PRESETS
from dlama.training.settings import TrainSettings, one_of


def to_json(settings: TrainSettings) -> str:
    """As a run directory keeps them."""
    return json.dumps(asdict(settings), indent=2) + "\n"


def from_json(text: str, file: str = "settings") -> TrainSettings:
    """Back again; FileError for anything that is no settings file of this version, naming the first field."""
    try:
        said = json.loads(text)
    except ValueError as error:
        raise FileError(f"{file}: no JSON ({error})") from error
    try:
        return typing.cast(TrainSettings, _built(TrainSettings, said, ""))
    except InputError as error:
        raise FileError(f"{file}: {error}") from error


def settings_of(name_or_file: str | Path) -> TrainSettings:
    """A preset by its name, or a JSON file's settings; InputError lists the presets, FileError as `from_json`."""
    if str(name_or_file) in PRESETS:
        return PRESETS[str(name_or_file)].settings
    path = Path(name_or_file)
    if not path.is_file():
        raise InputError(f"{name_or_file}: neither a settings file nor one of the presets {', '.join(PRESETS)}")
    try:
        return from_json(path.read_text("utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: cannot be read ({error})") from error


def _built(kind: type, said: Any, at: str) -> Any:
    """A dataclass from its table."""
    if not isinstance(said, dict):
        raise InputError(f"{at.rstrip('.') or 'the file'} is {said!r}; a table is wanted")
    hints = typing.get_type_hints(kind)
    unknown = [name for name in said if name not in hints]
    if unknown:
        raise InputError(f"{at}{unknown[0]} is no setting; the known ones are {', '.join(hints)}")
    return kind(**{name: _value(hints[name], value, f"{at}{name}") for name, value in said.items()})


def _value(kind: Any, value: Any, at: str) -> Any:
    if is_dataclass(kind):
        return _built(typing.cast(type, kind), value, f"{at}.")
    origin, inside = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return None if value is None else _value(inside[0], value, at)
    if origin is Literal:
        one_of(at, value, inside)
        return value
    if origin is not None:  # the one table: kind of sample -> share
        table = value if isinstance(value, dict) else {at: None}
        return {str(name): _value(float, share, f"{at}.{name}") for name, share in table.items()}
    if kind is float and type(value) is int:
        return float(value)
    if type(value) is not kind:
        raise InputError(f"{at} is {value!r}; {kind.__name__} is wanted")
    return value
