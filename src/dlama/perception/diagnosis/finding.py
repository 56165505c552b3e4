"""The two nouns of a diagnosis: what a check examines (stored numbers, picture, camera) and what it reports (findings)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import BoolArray, UInt8Array

Severity = Literal["fault", "note", "fine"]
"""fault: results would be wrong; note: worth knowing; fine: how the input was understood."""
CERTAIN = 0.9
"""Probability from which a finding is certain."""
LIKELY = 0.7


@dataclass(frozen=True)
class Finding:
    """One finding about the inputs."""

    check: str
    """Name of the fault, e.g. "depth-scale", "mirrored"; "understood" for how the input was read."""
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


def understood(names: str, parts: Sequence[str], found: Sequence[Finding]) -> Finding:
    """The last finding: what was made of the inputs, in `parts`, after those that were `found`."""
    verdict = "read as" if any(each.severity == "fault" for each in found) else "nothing wrong:"
    return Finding("understood", "fine", 1.0, f"{names}: {verdict} {', '.join(parts)}")


def describe_probability(confidence: float) -> str:
    """A probability in words."""
    return "certain" if confidence >= CERTAIN else "likely" if confidence >= LIKELY else "perhaps"


def certainty(evidence: float, half: float) -> float:
    """Probability 0.5..0.99 from evidence >= 0: 0.5 at 0, 0.75 at `half`."""
    return round(float(min(0.99, 1 - 0.5 * 0.5 ** (max(evidence, 0.0) / half))), 2)


@dataclass(frozen=True, eq=False)
class Observed:
    """A picture with its depth file, before any interpretation."""

    color: UInt8Array
    """H x W x 3 RGB."""
    values: NDArray[np.float64]
    """H x W, as stored; 0 = missing, +inf = far."""
    units: float
    """Values per metre as they would be read."""
    camera: Camera
    mask: BoolArray | None = None
    """H x W, True = remove."""
    names: tuple[str, str, str] = ("image", "depth", "mask")
    """How messages call the three."""
    whole: bool = False
    """Stored as whole numbers."""

    @property
    def valid(self) -> BoolArray:
        """H x W, True where depth has a finite value > 0."""
        return np.asarray((self.values > 0) & (self.values < np.inf), np.bool_)
