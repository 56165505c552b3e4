"""`dlama worlds`: a seed in; scenes with exact ground truth out, in EasySynth's layout."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Literal

from dlama.apps.options import Report, Seed, option
from dlama.apps.places import check_folder_apart
from dlama.apps.terminal.output import counting_bar, report_result
from dlama.errors import format_count


def worlds(
    report: Report,
    output: Annotated[Path, option("DIR", "dlama-worlds", aliases=["-o"])] = Path("dlama-worlds"),
    count: Annotated[int, option("N", "4")] = 4,
    seed: Seed = 0,
    size: Annotated[int, option("PX", "512")] = 512,
    kind: Annotated[Literal["room", "street"] | None, option("room|street", "drawn by the seed")] = None,
    textures: Annotated[Path | None, option("DIR", "procedural")] = None,
) -> None:
    """Generated scenes with exact ground truth, in EasySynth's layout: all that `dlama evaluate` needs, without other data.

    Args:
        output: Directory for the scenes.
        count: How many scenes.
        seed: The same seed gives the same scenes.
        size: Side of the square pictures.
        kind: Rooms or streets.
        textures: A folder of photos to paint surfaces with.
    """
    scene = {"size": size, "kind": kind, "textures": textures}
    check_folder_apart(output, {"folder of textures": textures})
    with report_result("worlds", report) as result, counting_bar("worlds", report) as progress:
        from dlama.worlds.writer import write_worlds  # in here, so that what it warns of is one line

        scenes = write_worlds(output, count=count, seed=seed, progress=progress, **scene)  # type: ignore[arg-type]
        line = f"{output}: {format_count(len(scenes), 'scene')}. Next: dlama evaluate {shlex.quote(str(output))} -o dlama-report"
        result.add(line, output=str(output), scenes=[str(scene) for scene in scenes])
