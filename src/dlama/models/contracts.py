"""A contract (what a network takes and gives, a dataclass) in -> the text for a network file's metadata out; and back.

Contracts of depth, stereo and mask networks are written and read here. `dlama.inpainters.networks.contract`, whose files are
made by `dlama models convert`, checks more; the key of the metadata is the same.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np

from dlama.arguments import check_arguments
from dlama.errors import FileError, InputError, any_error
from dlama.geometry.rgbd import Float32Array
from dlama.models.network_file import NetworkFile

CONTRACT_KEY = "dlama.contract"
"""Key of the ONNX metadata under which a file's contract stands, as JSON."""
C = TypeVar("C", bound="ColorContract")


@dataclass(frozen=True, kw_only=True)
class ColorContract:
    """What the contracts of networks that take colours share."""

    network: ClassVar[str]
    """The kind of network, such as "monocular depth"."""
    scale: float = 1 / 255
    """A colour c of 0..255 is shown as (c * scale - mean) / std."""
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def check_colors(self) -> None:
        """InputError for contradictions."""
        if len(self.mean) != 3 or len(self.std) != 3 or min(self.std) <= 0 or self.scale <= 0:
            raise InputError("contract: mean and std of three colours, std and scale above 0 are expected")

    def normalize(self, color: np.ndarray) -> Float32Array:
        """A picture (H x W x 3, 0..255) as the network takes its colours."""
        scaled = color.astype(np.float32) * np.float32(self.scale)
        return ((scaled - np.asarray(self.mean)) / np.asarray(self.std)).astype(np.float32)

    def metadata(self) -> dict[str, str]:
        """The ONNX metadata that says all this."""
        return {CONTRACT_KEY: json.dumps({"network": self.network, **asdict(self)})}

    @classmethod
    def of_file(cls: type[C], file: NetworkFile) -> C | None:
        """The contract in a network file's metadata; None where there is none. FileError where it is another network's."""
        text = file.metadata.get(CONTRACT_KEY)
        return None if text is None else cls.read(text, file.path)

    @classmethod
    def read(cls: type[C], text: str, file: Path) -> C:
        """The contract that the JSON of `text` says, which may be written by hand. FileError, naming `file`, where it is another
        network's, has a field that there is not, a value of another type, or cannot be read."""
        with contract_errors(file):
            words = json.loads(text)
            if words.get("network") != cls.network:
                raise FileError(
                    f"{file}: is a network {words.get('network')!r} by its contract; {cls.network} is expected"
                )
            known = {one.name for one in fields(cls)}
            if strange := sorted(set(words) - known - {"network", "version"}):
                raise FileError(f"{file}: its contract has {', '.join(strange)}; known are {', '.join(sorted(known))}")
            values: dict[str, Any] = {
                name: tuple(one) if isinstance(one, list) else one for name, one in words.items() if name in known
            }
            check_arguments(cls, values)
            return cls(**values)


@contextmanager
def contract_errors(file: object) -> Iterator[None]:
    """Context: what a contract that cannot be raises becomes a FileError that names the file."""
    try:
        with any_error(FileError, f"{file}: its contract cannot be read"):
            yield
    except FileError:
        raise
    except InputError as error:
        raise FileError(f"{file}: {error}") from error
