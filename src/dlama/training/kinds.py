"""The name of a planes kind or a sample kind in -> what it is, out: the two tables that a new kind is added to. Needs no torch.

A new kind of planes is one entry of PLANES, and keys of its own in `data.batches.keys_of` where it has any. A new kind of sample
is one entry of SAMPLES and one function in `data.sources.MAKERS`. A new loss term is one weight in `settings.LossSettings` and
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

    views: tuple[int, ...] = (1,)
    """Pictures per sample that it can give: 1 for one view, 2 for a stereo pair."""
    photos: bool = False
    """Whether photos of the data are used, as textures of worlds."""
    cases: str | None = None
    """The kind of dataset case that samples can be made of: frame, removal, stereo (see `data.cases.TrainingCase`)."""
    cases_required: bool = False
    """Whether there are no samples without such cases; else what no case gives is made of procedural worlds, the share that is
    `data.cases` less than 1."""


SAMPLES: dict[str, SampleKind] = {
    "sketch": SampleKind(views=(1, 2)),
    "world": SampleKind(photos=True),
    "frame": SampleKind(cases="frame", cases_required=True),
    "removal": SampleKind(photos=True, cases="removal"),
    "stereo": SampleKind(views=(2,), photos=True, cases="stereo"),
}
"""Names are those of `data.mixture` in settings files; `sketch` are the scenes of `data.samples.toy_scenes`."""
