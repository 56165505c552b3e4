"""A contract (what a network takes and gives, a dataclass) in -> the text for a network file's metadata out; and back.

Contracts of depth, stereo and mask networks are written and read here. `dlama.inpainters.networks.contract`, whose files are
made by `dlama models convert`, checks more; the key of the metadata is the same.
"""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from dlama.errors import FileError, InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    AnyContract = TypeVar("AnyContract", bound=DataclassInstance)

CONTRACT_KEY = "dlama.contract"
"""Key of the ONNX metadata under which a file's contract stands, as JSON."""


def contract_metadata(network: str, contract: DataclassInstance) -> dict[str, str]:
    """The ONNX metadata that says all this; network: the kind of network, such as "monocular depth"."""
    return {CONTRACT_KEY: json.dumps({"network": network, **asdict(contract)})}


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
