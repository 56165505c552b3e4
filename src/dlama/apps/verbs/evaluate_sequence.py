"""`dlama evaluate --protocol sequence`: posed frames in; tables by number of source frames, on held-out frames, out."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dlama.apps.options import Report
from dlama.apps.terminal.output import counting_bar, reported
from dlama.errors import InputError

HELD_OUT = 5
"""Frames, evenly over the sequence, unless --limit says otherwise."""
COLUMNS = ("held_out", "frames", "method", "region", "modality", "metric", "value")


def evaluate_sequence(dataset: str, output: Path, report: Report, cases: Mapping[str, Any]) -> None:
    """Held-out frames made of 1, 2, 4 and 8 others: sequence.md and sequence.csv in the directory `output`.

    cases: the options protocol, scenes, layout, camera, depth_range and limit by name.
    """
    from dlama.datasets.sequences.loading import ReadFrames, read_views
    from dlama.datasets.sequences.scene_frames import open_frames
    from dlama.evaluation.protocols.methods import ProtocolSettings
    from dlama.evaluation.protocols.sequence import APART, COUNTS, Row, score_sequence, table
    from dlama.files.atomic_write import new_directory
    from dlama.geometry.frames.stored import PixelCache

    if cases["protocol"] != ("sequence",):
        raise InputError("protocol sequence goes alone, it takes other cases than the others")
    if len(cases["scenes"]) > 1:
        raise InputError(f"scenes are {', '.join(cases['scenes'])}; protocol sequence takes one at a time")
    with reported("evaluate", report) as result, counting_bar("sequence", report) as bar:
        options = {name: cases[name] for name in ("layout", "camera", "depth_range")}
        listed = open_frames(dataset, **options, scene=next(iter(cases["scenes"]), None))
        names = list(read_views(listed, PixelCache())[0])
        frames = ReadFrames([frame for frame in listed if frame.name in names])
        if len(frames) < APART + 1:
            raise InputError(f"{dataset}: has {len(frames)} frames; {APART + 1} or more are wanted")
        count = min(cases["limit"] or HELD_OUT, len(frames))
        held = sorted({round((number + 0.5) * len(frames) / count - 0.5) for number in range(count)})
        rows: list[Row] = []
        for done, place in enumerate(held):
            if bar is not None:
                bar(done, len(held), f"sequence: {names[place]}")
            rows += score_sequence(frames, [place], names, ProtocolSettings(), counts=COUNTS)
        regions = ("whole", "seen by one", "seen by several", "seen by none")
        parts = [f"**{region}**\n\n{table(rows, region)}" for region in regions]
        with new_directory(output) as folder:
            (folder / "sequence.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
            text = io.StringIO()
            writer = csv.writer(text, lineterminator="\n")
            writer.writerow(COLUMNS)
            writer.writerows([row.held_out, row.frames, row.method, *row.measure] for row in rows)
            (folder / "sequence.csv").write_text(text.getvalue(), encoding="utf-8")
        line = f"{output / 'sequence.md'}: {len(held)} held-out frames of {len(frames)}, {len(rows)} numbers"
        result.add(line, output=str(output), held_out=[names[place] for place in held])
