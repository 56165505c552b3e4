"""A weight file from any source in -> the checked tensors of one network out; numpy alone, and no code of the file is run.

Read are the official Lightning checkpoint (`state_dict`, names under `generator.`), the TorchScript archive (names
under `model.generator.`), a plain state dict saved by torch, and safetensors. Loading is strict: the tensors make
up exactly one network, or the file is refused with the first names that differ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlama.errors import FileError, ShapeError, system_errors
from dlama.nets.architecture import STEM, GeneratorSettings, Shapes, generator_shapes, settings_from_state
from dlama.nets.safetensors_file import read_safetensors
from dlama.nets.torch_file import TorchFile

COUNTER = ".num_batches_tracked"
MEANT = ("average.", "generator.", "model.generator.")
"""Prefixes of the network that is used; dlama's training exports the moving average of its generator."""


@dataclass(frozen=True)
class GeneratorWeights:
    """The tensors of one generator, complete and finite, and the kind of their file."""

    settings: GeneratorSettings
    """Read from the tensors' shapes; the activation is that of the file's metadata, else sigmoid, as published."""
    state: dict[str, np.ndarray]
    """Published name -> float32 array (int64 scalars for the batch norms' counters)."""
    kind: str
    """lightning, torchscript, torch or safetensors."""
    notes: tuple[str, ...]
    """Notes for the user: what else the file holds and was left, what was converted."""


def read_generator(path: Path | str) -> GeneratorWeights:
    """The generator in that file.

    Args:
        path: .ckpt, .pth, .pt (TorchScript or a state dict) or .safetensors; recognised by content, not by name.
    Raises:
        FileError: no such file, truncated, no archive, no generator in it, half of one, NaN in it.
    """
    file = _open(Path(path))
    prefix = _prefix(file)
    shapes = {name[len(prefix) :]: shape for name, shape in file.shapes.items() if name.startswith(prefix)}
    activation = file.metadata.get("activation", "sigmoid")  # as published
    try:
        settings = settings_from_state(_add_counters(shapes), activation)
    except ShapeError as error:
        where = f"under {prefix!r} " if prefix else ""
        raise FileError(f"{path}: {where}{error}") from error
    state, notes = _check_state(file, prefix, generator_shapes(settings))
    left = (*_describe_unread(file, prefix), *notes)
    return GeneratorWeights(settings, state, file.kind, left)


def widen(state: Mapping[str, np.ndarray], in_channels: int, out_channels: int) -> dict[str, np.ndarray]:
    """The generator with that many planes, which at step 0 fills colour exactly as before: from the published 4 -> 3 network to
    5 -> 4 (colour, depth, mask) and 7 -> 6 (two colours, mask).

    Colour stays first and the mask stays the last input plane. New input planes get zero weights, new output planes get zero
    weights and bias, so a sigmoid says 0.5 there. Gradients reach both from the first step on.

    Args:
        state: published name -> array, one whole generator.
        in_channels: expected input planes, the mask counted; not fewer than there are.
        out_channels: expected output planes; not fewer than there are.
    Raises:
        ShapeError: fewer planes expected than there are, or the state is no generator.
    """
    settings = settings_from_state({name: array.shape for name, array in state.items()})
    more_in, more_out = in_channels - settings.in_channels, out_channels - settings.out_channels
    if more_in < 0 or more_out < 0:
        had = f"{settings.in_channels} -> {settings.out_channels}"
        raise ShapeError(f"surgery: {had} planes cannot become {in_channels} -> {out_channels}: planes are only added")
    stem, head = state[STEM], f"model.{settings.head_index}"
    new_planes = np.zeros((stem.shape[0], more_in, *stem.shape[2:]), stem.dtype)
    widened = {name: array.copy() for name, array in state.items()}
    widened[STEM] = np.concatenate([stem[:, :-1], new_planes, stem[:, -1:]], axis=1)
    for name in (f"{head}.weight", f"{head}.bias"):
        old = state[name]
        widened[name] = np.concatenate([old, np.zeros((more_out, *old.shape[1:]), old.dtype)])
    return widened


@dataclass(frozen=True)
class _File:
    path: Path
    kind: str
    shapes: dict[str, tuple[int, ...]]
    metadata: dict[str, str]
    others: tuple[str, ...]
    load: Callable[[list[str]], dict[str, tuple[np.ndarray, str]]]


def _open(path: Path) -> _File:
    """Recognised by the first bytes, since all of these occur under all of the suffixes."""
    with system_errors(FileError), path.open("rb") as file:
        head = file.read(16)
    if head.startswith(b"PK"):
        archive = TorchFile(path)
        shapes = {name: tensor.shape for name, tensor in archive.tensors.items()}
        return _File(path, archive.kind, shapes, {}, archive.others, archive.read)
    if head[8:9] == b"{":  # after the length of its header
        arrays, codes, metadata = read_safetensors(path)
        shapes = {name: array.shape for name, array in arrays.items()}
        pairs = {name: (array, codes[name]) for name, array in arrays.items()}
        return _File(path, "safetensors", shapes, metadata, (), lambda names: {name: pairs[name] for name in names})
    if head[:1] == b"\x80":
        raise FileError(
            f"{path}: a bare pickle (torch before 1.6), which is not read; save it again with a newer torch"
        )
    raise FileError(f"{path}: neither a torch archive nor safetensors (it begins with {head[:9]!r})")


def _prefix(file: _File) -> str:
    """Prefix of the published names; where several networks have them, the first of MEANT."""
    found = [name[: -len(STEM)] for name in file.shapes if name == STEM or name.endswith("." + STEM)]
    found = [prefix for prefix in MEANT if prefix in found][:1] or found
    if len(found) != 1:
        what = f"{len(found)} networks have" if found else "no tensor is called"
        raise FileError(
            f"{file.path}: {what} {STEM}; the first of {len(file.shapes)} names: {_first_of(list(file.shapes))}"
        )
    return found[0]


def _check_state(file: _File, prefix: str, expected: Shapes) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Arrays in the published order, float32 and finite; and what had to be done for that."""
    present = [name for name in expected if prefix + name in file.shapes]
    loaded = file.load([prefix + name for name in present])
    state: dict[str, np.ndarray] = {}
    converted: dict[str, int] = {}
    for name in expected:
        if name.endswith(COUNTER):  # how many batches were seen: of no use to the network's output
            counted = loaded[prefix + name][0] if prefix + name in loaded else 0
            state[name] = np.asarray(counted, np.int64).reshape(())
            continue
        array, code = loaded[prefix + name]
        if array.dtype.kind != "f":
            raise FileError(f"{file.path}: {prefix}{name} holds {code}, expected floating point numbers")
        if code != "F32":
            converted[code] = converted.get(code, 0) + 1
        state[name] = _require_finite(file.path, prefix + name, array)
    notes = [f"{number} tensors of {code} were converted to float32" for code, number in converted.items()]
    absent = len(expected) - len(present)
    return state, (*notes, *([f"{absent} batch-norm counters are absent and were set to 0"] if absent else []))


def _require_finite(path: Path, name: str, array: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        array = np.ascontiguousarray(array, np.float32)
    if not np.isfinite(array).all():
        raise FileError(f"{path}: {name} holds {int((~np.isfinite(array)).sum())} numbers that are NaN or infinite")
    if name.endswith(".running_var") and (array < 0).any():
        raise FileError(f"{path}: {name} holds negative variances")
    return array


def _describe_unread(file: _File, prefix: str) -> tuple[str, ...]:
    """One line about the rest of the file, by the first word of its names."""
    groups: dict[str, int] = {}
    for name in file.shapes:
        if not name.startswith(prefix):
            groups[name.split(".")[0]] = groups.get(name.split(".")[0], 0) + 1
    parts = [f"{number} tensors of {group}" for group, number in groups.items()] + list(file.others)
    return (f"left in the file: {_first_of(parts, 8)}",) if parts else ()


def _add_counters(shapes: Shapes) -> dict[str, tuple[int, ...]]:
    """Counters that some writers strip are taken as present; they are the only names that may be absent."""
    norms = [name[: -len(".running_var")] for name in shapes if name.endswith(".running_var")]
    return {norm + COUNTER: () for norm in norms} | dict(shapes)


def _first_of(names: list[str], show: int = 3) -> str:
    return ", ".join(names[:show]) + (f", ... ({len(names) - show} more)" if len(names) > show else "") or "none"
