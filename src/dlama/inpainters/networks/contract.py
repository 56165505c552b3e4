"""Contract of a network file: its ONNX metadata (or a record given by hand) in; its inputs and outputs, checked, out.

Only this file defines the names and scales of planes. Writers of network files get their metadata here (`generator_metadata`),
and the engine reads it here (`from_metadata`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from dlama.arguments import check, check_count
from dlama.errors import FileError, InputError
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.models.contracts import CONTRACT_KEY, contract_errors
from dlama.models.verify import sha256_of

FIELDS = ("in_planes", "out_planes", "in_range", "out_range", "mask", "hole", "multiple", "minimum")
"""What every file's contract says."""
COLOR = ("red", "green", "blue")
PAIR = (*COLOR, *(f"other {name}" for name in COLOR))
"""Of a stereo pair: the left picture's planes, then the right one's."""
PLANES = {1: ("depth",), 3: COLOR, 4: (*COLOR, "depth"), 6: PAIR}
"""Number of planes a network gives -> their names."""
LARGEST_VALUE = 1e6
"""Of a plane."""
LONGEST_TEXT = 1_000_000
"""Characters of a contract."""
MASKS = {1: ("mask",), 2: ("left mask", "right mask")}
"""Number of masks -> their names. Two belong to a pair, one to each picture; one is shared by all planes."""
DEPTH_QUANTILE, DEPTH_AT_QUANTILE = 0.99, 0.75
"""A depth plane is inverse depth, scaled so that this quantile of the known pixels has this value. The room above is for nearer
surfaces, such as ground before the picture's lower edge."""
_SCALE = f"{DEPTH_AT_QUANTILE} = what {100 * DEPTH_QUANTILE:.0f} % of the known pixels do not exceed"
DEPTH_PLANE = f"inverse depth, 0 = infinity, {_SCALE}"
"""The same in words, as it stands in the metadata."""


@dataclass(frozen=True)
class Contract:
    """What the engine must know of a network. Contradictions, and what the engine does not support, raise InputError."""

    in_planes: tuple[str, ...]
    """Names of the planes the network takes, the mask (or the left and the right mask) last."""
    out_planes: tuple[str, ...]
    """Names of the planes it gives: the known planes again, without the masks."""
    in_range: tuple[float, float] = (0.0, 1.0)
    """Values of 0 and full scale in its input."""
    out_range: tuple[float, float] | None = (0.0, 1.0)
    """The same of its output; None: as the input, but unbounded."""
    mask: str = "1 = fill"
    """Polarity of the mask planes: `1 = fill` or `0 = fill`."""
    hole: str = "zero"
    """Value of the known planes in the hole: `zero`."""
    multiple: int = 8
    """Height and width must be multiples of this many pixels."""
    minimum: int = 16
    """Smallest height and width in pixels."""
    network: str = "unknown"
    """`lama`, `migan` ..."""
    side: int | None = None
    """The largest height and width it takes, in pixels; None: any that `multiple` and `minimum` allow."""

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(Contract).items():
            check(getattr(self, name), kind, f"contract: {name}")
        self._check_planes()
        if self.mask not in ("1 = fill", "0 = fill"):
            raise InputError(f"contract: mask is {self.mask!r}; '1 = fill' or '0 = fill' is expected")
        if self.hole != "zero":
            raise InputError(f"contract: hole is {self.hole!r}; 'zero' is expected")
        for name in ("in_range", "out_range"):
            self._check_range(name)
        for name in ("multiple", "minimum", "side"):
            # pixels: the memory that a network takes grows with their square
            check_count(getattr(self, name), f"contract: {name}", 1, 4096)

    def _check_planes(self) -> None:
        known, masks = self.in_planes[: len(self.out_planes)], self.in_planes[len(self.out_planes) :]
        if masks not in MASKS.values() or known != self.out_planes or not known:
            raise InputError(
                f"contract: planes in {list(self.in_planes)} and out {list(self.out_planes)}; expected the same planes "
                "in and out, and a mask last in ('mask', or of a pair 'left mask' and 'right mask')"
            )
        if self.masks > 1 and len(known) != len(PAIR):
            raise InputError(f"contract: a left and a right mask with {len(known)} planes; a pair has {len(PAIR)}")

    def _check_range(self, name: str) -> None:
        pair = getattr(self, name)
        if pair is None:
            return
        if not (len(pair) == 2 and pair[0] < pair[1]):
            raise InputError(f"contract: {name} is {pair}; two rising numbers are expected")
        if not max(map(abs, pair)) <= LARGEST_VALUE:
            raise InputError(f"contract: {name} is {pair}; numbers up to {LARGEST_VALUE:g} are expected")

    @property
    def masks(self) -> int:
        """Mask planes: 2 for a pair whose pictures have one each, else 1."""
        return len(self.in_planes) - len(self.out_planes)

    def hole_of_planes(self, holes: BoolArray) -> BoolArray:
        """Planes x H x W of holes (masks x H x W): for each plane the hole of its picture."""
        return np.repeat(holes, len(self.out_planes) // self.masks, 0)

    def network_input(self, planes: Float32Array, holes: BoolArray) -> Float32Array:
        """The network's input, B x C x H x W, from B x planes x H x W in 0..1 and holes (masks x H x W): each picture zeroed in
        its own hole, then the masks."""
        low, high = self.in_range
        known = (low + planes * np.float32(high - low)) * ~self.hole_of_planes(holes)
        masks = (holes if self.mask == "1 = fill" else ~holes).astype(np.float32)
        return np.concatenate([known.astype(np.float32), np.broadcast_to(masks, (len(planes), *masks.shape))], 1)

    def unit_output(self, out: Float32Array) -> Float32Array:
        """The network's output on the scale 0..1; not clipped."""
        low, high = self.out_range or self.in_range
        return np.asarray((out - np.float32(low)) / np.float32(high - low), np.float32)

    def metadata(self, **provenance: object) -> dict[str, str]:
        """The ONNX metadata that says all this; provenance (licence, source ...): further entries, JSON-ready, after it."""
        depth = {"depth": DEPTH_PLANE} if "depth" in self.out_planes else {}
        words = {"version": 1, "network": self.network} | {name: getattr(self, name) for name in FIELDS}
        side = {} if self.side is None else {"side": self.side}
        return {CONTRACT_KEY: json.dumps(depth | words | side | provenance)}


def generator_contract(settings: Any) -> Contract:
    """The contract of a LaMa generator of those settings (`dlama.nets.architecture.GeneratorSettings`). InputError where no
    contract fits its numbers of planes."""
    names = PLANES.get(settings.out_channels, tuple(f"plane {i}" for i in range(settings.out_channels)))
    ranges: dict[str, tuple[float, float] | None] = {"sigmoid": (0.0, 1.0), "tanh": (-1.0, 1.0), "none": None}
    masks = settings.in_channels - settings.out_channels
    if masks not in MASKS:
        raise InputError(
            f"contract: {settings.in_channels} planes in and {settings.out_channels} out; the same planes in and out are "
            "expected, and one mask (or of a pair two) in"
        )
    return Contract(
        (*names, *MASKS[masks]),
        names,
        out_range=ranges[settings.activation],
        multiple=settings.multiple,
        minimum=settings.minimum,
        network="lama",
    )


def generator_metadata(settings: Any, source: Path, licence: str) -> dict[str, str]:
    """ONNX metadata for a generator made of the weight file `source`: its contract, the licence, the file's name and sha256, and
    all settings. licence: an SPDX name or a sentence. InputError where no contract fits, or the file cannot be read."""
    return generator_contract(settings).metadata(
        licence=licence, source=source.name, source_sha256=sha256_of(source), architecture=vars(settings)
    )


def from_metadata(metadata: Mapping[str, str], file: str) -> Contract | None:
    """The contract that stands in a file's metadata; None where there is none, FileError where it cannot be read."""
    text = metadata.get(CONTRACT_KEY)
    if text is None:
        return None
    with contract_errors(file):
        if len(text) > LONGEST_TEXT:
            raise FileError(f"{file}: its contract has {len(text)} characters; at most {LONGEST_TEXT} are read")
        words = json.loads(text)
        if not isinstance(words, dict):
            raise FileError(f"{file}: its contract is a {type(words).__name__}; a table is expected")
        missing = [name for name in FIELDS if name not in words]
        if missing:
            raise FileError(f"{file}: its contract lacks {', '.join(missing)}")
        known = [one.name for one in fields(Contract)]
        values: dict[str, Any] = {
            name: tuple(one) if isinstance(one, list) else one for name, one in words.items() if name in known
        }
        return Contract(**values)


def require_planes(contract: Contract, planes: int, file: str, filler: str) -> None:
    """InputError unless the network gives that many planes; the message names the filler that runs it."""
    if len(contract.out_planes) != planes:
        other = {3: "lama", 4: "joint", 6: "pair"}.get(len(contract.out_planes))
        hint = f"; the filler {other!r} runs it" if other else ""
        expected = f"{planes + 1} or {planes + 2}" if planes == len(PAIR) else planes + 1
        raise InputError(
            f"{file}: takes {len(contract.in_planes)} planes and gives {len(contract.out_planes)}; "
            f"the filler {filler!r} needs {expected} in and {planes} out{hint}"
        )
