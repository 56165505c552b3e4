"""A contract (what a network takes and gives, a dataclass) in -> the text for a network file's metadata out; and back.

Contracts of depth, stereo and mask networks are written and read here. `dlama.inpainters.networks.contract`, whose files are
made by `dlama models convert`, checks more; the key of the metadata is the same.
"""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dlama.errors import FileError, InputError
from dlama.geometry.rgbd import Float32Array
from dlama.models.network_file import NetworkFile

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    AnyContract = TypeVar("AnyContract", bound=DataclassInstance)

CONTRACT_KEY = "dlama.contract"
"""Key of the ONNX metadata under which a file's contract stands, as JSON."""


class ColorContract:
    """Part of a contract that says how a network takes colours; its fields stand in the contract itself."""

    scale: float
    """A colour c of 0..255 is shown as (c * scale - mean) / std."""
    mean: tuple[float, float, float]
    std: tuple[float, float, float]

    def check_colors(self) -> None:
        """InputError for contradictions."""
        if len(self.mean) != 3 or len(self.std) != 3 or min(self.std) <= 0 or self.scale <= 0:
            raise InputError("contract: mean and std of three colours, std and scale above 0 are expected")

    def normalize(self, color: np.ndarray) -> Float32Array:
        """A picture (H x W x 3, 0..255) as the network takes its colours."""
        scaled = color.astype(np.float32) * np.float32(self.scale)
        return ((scaled - np.asarray(self.mean)) / np.asarray(self.std)).astype(np.float32)


def contract_metadata(network: str, contract: DataclassInstance) -> dict[str, str]:
    """The ONNX metadata that says all this; network: the kind of network, such as "monocular depth"."""
    return {CONTRACT_KEY: json.dumps({"network": network, **asdict(contract)})}


def contract_of_file(kind: type[AnyContract], network: str, file: NetworkFile) -> AnyContract | None:
    """The contract in a network file's metadata; None where there is none. FileError where it is another network's."""
    text = file.metadata.get(CONTRACT_KEY)
    return None if text is None else read_contract(kind, text, network, file.path)


def read_contract(kind: type[AnyContract], text: str, network: str, file: Path, *, strict: bool = False) -> AnyContract:
    """The contract that the JSON of `text` says. FileError, naming `file`, where it is another network's or cannot be read.

    strict: the text may be written by hand, so that fields which `kind` does not have are refused instead of passed over.
    """
    try:
        words = json.loads(text)
        if words.get("network") != network:
            expected = repr(network) if strict else network
            raise FileError(f"{file}: is a network {words.get('network')!r} by its contract; {expected} is expected")
        known = {one.name for one in fields(kind)}
        strange = sorted(set(words) - known - {"network", "version"})
        if strict and strange:
            raise FileError(f"{file}: its contract has {', '.join(strange)}; known are {', '.join(sorted(known))}")
        listed: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in words.items() if name in known
        }
        return kind(**listed)
    except FileError:
        raise
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        if strict and isinstance(error, InputError):
            raise FileError(f"{file}: {error}") from error
        raise FileError(f"{file}: its contract cannot be read ({error})") from error
