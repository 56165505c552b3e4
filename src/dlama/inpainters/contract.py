"""A network file's own words in (ONNX metadata), or a hand-given record: what the network takes and gives, checked, out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dlama.errors import FileError, InputError

CONTRACT_KEY = "dlama.contract"
"""Key of the ONNX metadata under which the contract stands, as JSON (`dlama models convert` writes it)."""
FIELDS = ("in_planes", "out_planes", "in_range", "out_range", "mask", "hole", "multiple", "minimum")
COLOR = ("red", "green", "blue")


@dataclass(frozen=True)
class Contract:
    """What whoever runs a network must know. Contradictions and what the engine cannot serve raise InputError."""

    in_planes: tuple[str, ...]
    """Names of the planes the network takes, the mask last."""
    out_planes: tuple[str, ...]
    """Names of the planes it gives: the known planes again, without the mask."""
    in_range: tuple[float, float] = (0.0, 1.0)
    """What 0 and full scale are called in its input."""
    out_range: tuple[float, float] | None = (0.0, 1.0)
    """The same of its output; None: as the input, but nothing bounds it."""
    mask: str = "1 = fill"
    """Polarity of the mask plane: `1 = fill` or `0 = fill`."""
    hole: str = "zero"
    """What stands in the hole of the known planes: `zero`."""
    multiple: int = 8
    """Height and width must be multiples of this many pixels."""
    minimum: int = 16
    """Smallest height and width in pixels."""
    network: str = "unknown"
    """`lama`, `migan` ..."""

    def __post_init__(self) -> None:
        if self.in_planes[-1:] != ("mask",) or self.in_planes[:-1] != self.out_planes or not self.out_planes:
            raise InputError(
                f"contract: planes in {list(self.in_planes)} and out {list(self.out_planes)}; "
                "wanted the same planes in and out, and a mask last in"
            )
        if self.mask not in ("1 = fill", "0 = fill"):
            raise InputError(f"contract: mask is {self.mask!r}; '1 = fill' or '0 = fill' is wanted")
        if self.hole != "zero":
            raise InputError(f"contract: hole is {self.hole!r}; 'zero' is wanted")
        for name in ("in_range", "out_range"):
            pair = getattr(self, name)
            if pair is not None and not (len(pair) == 2 and pair[0] < pair[1]):
                raise InputError(f"contract: {name} is {pair}; two rising numbers are wanted")
        if self.multiple < 1 or self.minimum < 1:
            raise InputError(f"contract: multiple {self.multiple} and minimum {self.minimum}; 1 or more is wanted")


def of_planes(count: int, **changes: Any) -> Contract:
    """The contract of a LaMa of 3 (colour) or 4 (colour and depth) planes, given by hand for a file without one."""
    names = (*COLOR, "depth")
    if count not in (3, 4):
        raise InputError(f"contract: {count} planes; 3 (colour) or 4 (colour and depth) are wanted")
    return Contract((*names[:count], "mask"), names[:count], **changes)


def from_metadata(metadata: Mapping[str, str], file: str) -> Contract | None:
    """The contract that stands in a file's metadata; None where there is none, FileError where it cannot be read."""
    text = metadata.get(CONTRACT_KEY)
    if text is None:
        return None
    try:
        said = json.loads(text)
        missing = [name for name in FIELDS if name not in said]
        if missing:
            raise FileError(f"{file}: its contract lacks {', '.join(missing)}")
        out_range = None if said["out_range"] is None else tuple(map(float, said["out_range"]))
        return Contract(
            tuple(said["in_planes"]),
            tuple(said["out_planes"]),
            tuple(map(float, said["in_range"])),  # type: ignore[arg-type]
            out_range,  # type: ignore[arg-type]
            said["mask"],
            said["hole"],
            int(said["multiple"]),
            int(said["minimum"]),
            str(said.get("network", "unknown")),
        )
    except FileError:
        raise
    except InputError as error:
        raise FileError(f"{file}: {error}") from error
    except (ValueError, TypeError) as error:
        raise FileError(f"{file}: its contract cannot be read ({error})") from error


def demand(contract: Contract, planes: int, file: str, filler: str) -> None:
    """InputError unless the network fills that many planes."""
    if len(contract.out_planes) != planes:
        other = {3: "lama", 4: "joint", 6: "pair"}.get(len(contract.out_planes))
        hint = f"; the filler {other!r} runs it" if other else ""
        raise InputError(
            f"{file}: takes {len(contract.in_planes)} planes and gives {len(contract.out_planes)}; "
            f"the filler {filler!r} wants {planes + 1} in and {planes} out{hint}"
        )
