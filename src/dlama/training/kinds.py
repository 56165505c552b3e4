"""The name of a planes kind or a sample kind in -> what it is, out: the two tables that a new kind is added to. Needs no torch.

A new kind of planes is one entry of PLANES, and keys of its own in `data.batches.keys_of` where it has any. A new kind of sample
is one entry of SAMPLES and one in `data.sources.EXAMPLES`. A new loss term is one weight in `settings.LossSettings` and
one entry in `losses.terms.GENERATOR_TERMS`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from dlama.datasets.frames import Protocol

Planes = Literal["rgb", "rgbd", "stereo", "stereo-two-masks"]
"""The keys of PLANES."""


@dataclass(frozen=True)
class PlanesKind:
    """What the channels of a network's input and output are; mask planes come last in the input."""

    inputs: int
    """Channels of the input, masks counted."""
    outputs: int
    """Channels of the output."""
    description: str
    """For the model card."""
    views: int = 1
    """Pictures per sample: 2 for a stereo pair."""
    masks: int = 1
    """Mask planes."""
    has_depth: bool = False
    """Whether the last plane of the output is inverse depth."""


PLANES: dict[str, PlanesKind] = {
    "rgb": PlanesKind(4, 3, "colour (4 planes in, 3 out)"),
    "rgbd": PlanesKind(
        5, 4, "colour and depth together (5 planes in: red, green, blue, depth, mask; 4 out)", has_depth=True
    ),
    "stereo": PlanesKind(
        7,
        6,
        "both pictures of a stereo pair together (7 planes in: left, right, the union of both masks; 6 out)",
        views=2,
    ),
    "stereo-two-masks": PlanesKind(
        8,
        6,
        "both pictures of a stereo pair together (8 planes in: left, right, left mask, right mask; 6 out)",
        views=2,
        masks=2,
    ),
}


@dataclass(frozen=True)
class SampleKind:
    """What samples of a kind are made of."""

    views: int = 1
    """Pictures per sample: 2 for a stereo pair."""
    cases: Protocol | None = None
    """The protocol of the dataset's cases that samples can be made of."""
    worlds: bool = True
    """Whether samples can be made of procedural worlds, with photos of the data as textures: all where there is no case, else the
    share that is `data.cases` less than 1."""


SAMPLES: dict[str, SampleKind] = {
    "world": SampleKind(),
    "frame": SampleKind(cases="vpi", worlds=False),
    "removal": SampleKind(cases="ori"),
    "stereo": SampleKind(views=2, cases="sii"),
}
"""Names are those of `data.mixture` in settings files."""
