"""The name of a planes kind or a sample kind in -> what it is, out: the two tables that a new kind is added to. Needs no torch.

A new kind of planes is one entry of PLANES, and keys of its own in `data.batches.keys_of` where it has any. A new kind of sample
is one entry of SAMPLES and one in `data.sources.KINDS`. A new loss term is one weight in `settings.LossSettings` and
one entry in `losses.terms.GENERATOR_TERMS`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Planes = Literal["rgb", "rgbd", "stereo", "stereo-two-masks"]
"""The keys of PLANES."""


@dataclass(frozen=True)
class PlanesKind:
    """What the channels of a network's input and output are; mask planes come last in the input."""

    description: str
    """For the model card."""
    views: int = 1
    """Pictures per sample: 2 for a stereo pair."""
    masks: int = 1
    """Mask planes."""
    has_depth: bool = False
    """Whether the last plane of the output is inverse depth."""

    @property
    def outputs(self) -> int:
        """Channels of the output."""
        return 3 * self.views + self.has_depth

    @property
    def inputs(self) -> int:
        """Channels of the input, masks counted."""
        return self.outputs + self.masks


PAIR = "both pictures of a stereo pair together"
PLANES: dict[str, PlanesKind] = {
    "rgb": PlanesKind("colour (4 planes in, 3 out)"),
    "rgbd": PlanesKind("colour and depth together (5 planes in: red, green, blue, depth, mask; 4 out)", has_depth=True),
    "stereo": PlanesKind(f"{PAIR} (7 planes in: left, right, the union of both masks; 6 out)", 2),
    "stereo-two-masks": PlanesKind(f"{PAIR} (8 planes in: left, right, left mask, right mask; 6 out)", 2, 2),
}
SAMPLES = {"world": 1, "frame": 1, "removal": 1, "stereo": 2}
"""Kind of sample, as in `data.mixture` of settings files -> its pictures: 2 of a stereo pair."""
