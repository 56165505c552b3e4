"""The two nouns of a diagnosis: what a check examines (picture, depth, camera, mask) and what it reports (findings)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array, is_valid

Severity = Literal["fault", "note", "fine"]
"""fault: results would be wrong; note: worth knowing; fine: how the input was understood."""
CERTAIN = 0.9
"""Probability from which a finding is called so."""


@dataclass(frozen=True)
class Finding:
    """One finding about the inputs."""

    check: str
    """Name of the fault, e.g. "depth-scale", "mirrored-depth"; "understood" for how the input was read."""
    severity: Severity
    confidence: float
    """Probability, 0..1."""
    what: str
    """What was found, and the evidence."""
    mend: str = ""
    """The option, or the work, that fixes it; options as in Python (`depth_scale=5000`)."""

    @property
    def line(self) -> str:
        """All of it in one line."""
        mend = f"{'' if self.what.endswith('?') else ':'} {self.mend}" if self.mend else ""
        return f"{self.what}{mend}{'' if self.severity == 'fine' else f' ({describe_probability(self.confidence)})'}"


def describe_probability(confidence: float) -> str:
    """A probability in words."""
    return "certain" if confidence >= CERTAIN else "likely" if confidence >= 0.7 else "perhaps"


def certainty(evidence: float, half: float) -> float:
    """Probability 0.5..0.99 from evidence >= 0: 0.5 at 0, 0.75 at `half`."""
    return round(float(min(0.99, 1 - 0.5 * 0.5 ** (max(evidence, 0.0) / half))), 2)


@dataclass(frozen=True, eq=False)
class Observed:
    """A picture with its depth, as they were read."""

    color: UInt8Array
    """H x W x 3 RGB."""
    depth: NDArray[np.float64]
    """H x W metres; 0 = missing, +inf = far."""
    camera: Camera
    mask: BoolArray | None = None
    """H x W, True = remove."""
    units: float | None = None
    """Values a metre that the depth file was read with; None: no option says how it is read."""
    names: tuple[str, str, str] = ("image", "depth", "mask")
    """How messages call the three."""
    inverted: bool = False
    """Depth was read as 1 / the values of the file."""
    radial: bool = False
    """Depth was read from distances along the rays."""

    @classmethod
    def of(
        cls,
        rgbd: RGBD,
        names: tuple[str, str, str],
        mask: BoolArray | None = None,
        units: float | None = None,
        inverted: bool = False,
        radial: bool = False,
    ) -> Observed:
        """A frame that was read."""
        return cls(rgbd.color, rgbd.depth.astype(np.float64), rgbd.camera, mask, units, names, inverted, radial)

    @property
    def valid(self) -> BoolArray:
        """H x W, True where depth has a finite value > 0."""
        return is_valid(self.depth)
