"""`dlama worlds`: a seed in; scenes with exact ground truth out, in EasySynth's layout."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Literal

from dlama.apps.options import Output, told
from dlama.apps.terminal import shown_count


def worlds(
    output: Output = Path("dlama-worlds"),
    count: Annotated[int, told("N", "(default: 4)")] = 4,
    seed: Annotated[int, told("N", "(default: 0)")] = 0,
    size: Annotated[int, told("PX", "(default: 512)")] = 512,
    kind: Annotated[Literal["room", "street"] | None, told("room|street", "(default: drawn by the seed)")] = None,
    shadows: Annotated[bool, told("")] = True,
    antialias: Annotated[bool, told("")] = True,
    textures: Annotated[Path | None, told("DIR", "(default: procedural)")] = None,
) -> None:
    """Made-up scenes with exact ground truth, in EasySynth's layout: all that `dlama evaluate` needs, with no data at all.

    Args:
        output: Directory for the scenes.
        count: How many scenes.
        seed: The same seed gives the same scenes.
        size: Side of the square pictures.
        kind: Rooms or streets.
        shadows: Objects cast none (a trouble that the paper names).
        antialias: Colour edges are hard, exactly where depth changes.
        textures: A folder of photos to paint surfaces with.
    """
    from dlama.worlds.writer import write_worlds

    with shown_count("worlds") as progress:
        scenes = write_worlds(
            output,
            count=count,
            seed=seed,
            size=size,
            kind=kind,
            shadows=shadows,
            antialias=antialias,
            textures=textures,
            progress=progress,
        )
    made = f"{len(scenes)} scene{'s' * (len(scenes) != 1)}"
    print(f"{output}: {made}. Next: dlama evaluate {shlex.quote(str(output))} -o dlama-report")
