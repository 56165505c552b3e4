"""The options of `dlama evaluate`: which cases of a data set, which methods."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from dlama.apps.options import CameraFile, Metres, Seed, option
from dlama.completion.options import RECIPE_NAMES

NO_FILL = "none"
"""The filler that leaves holes as they are."""
Protocol = Literal["vpi", "ori", "sii"]


@dataclass(frozen=True)
class Cases:
    """Which cases of the data set are run."""

    protocol: Annotated[tuple[Protocol, ...], option("vpi|ori|sii ...", "vpi ori sii, as the data set has")] = ()
    """View change, object removal, stereo."""
    scenes: Annotated[tuple[str, ...], option("SCENE ...", "all")] = ()
    """Only these scenes."""
    yaws: Annotated[tuple[float, ...], option("DEG ...", "all")] = ()
    """Only cases about so many degrees round, to either side; of removal and stereo, which turn nothing, all."""
    limit: Annotated[int | None, option("N", "all")] = None
    """At most so many cases of each protocol, the first ones."""
    layout: Annotated[str | None, option("NAME", "recognised")] = None
    """How the data set lies on disk: easysynth, pairs, removal, stereo, tum, 7-scenes, scannet, ..."""
    depth_range: Metres = None
    """EasySynth: metres that 1.0 stands for in its depth files."""
    depth_scale: Annotated[float | None, option("UNITS", "the layout's")] = None
    """Units per metre in depth files of posed frames: 1000 = millimetres, Replica 6553.5."""
    removal_object: Annotated[str | None, option("NAME|R,G,B", "object")] = None
    """EasySynth: the semantic class that is removed."""
    camera: CameraFile = None
    """The camera file of a layout that has none of its own (tum, 7-scenes, redwood)."""


@dataclass(frozen=True)
class Methods:
    """Which methods are measured on them: every recipe with every filler."""

    recipes: Annotated[tuple[str, ...], option(f"{'|'.join(RECIPE_NAMES)} ...", "dlama paper")] = ("dlama", "paper")
    """Whole methods, ours and the paper's as published."""
    fillers: Annotated[tuple[str, ...], option("FILLER ...", "layered telea none")] = ("layered", "telea", NO_FILL)
    """Of none (holes stay), layered, layered-patches, telea, lama, migan, patchmatch, joint, pair."""
    model: Annotated[tuple[str, ...], option("FILLER=FILE|NAME ...")] = ()
    """The network of a filler that runs one: an ONNX file, a LaMa checkpoint, or a name of `dlama models list`."""
    seed: Seed = 0
    """Fillers and the bootstrap draw from this; the same seed gives the same numbers."""
    variants: Annotated[bool, option("", "they are run")] = True
    """Leave out the runs with other masks and dilations, and the stereo pairs matched by the method itself."""
