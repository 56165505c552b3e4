"""`dlama evaluate --protocol sequence`: posed frames in; tables by number of source frames, on held-out frames, out."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dlama.apps.options import Report
from dlama.apps.terminal.output import counting_bar, report_result
from dlama.datasets.frames import Dataset
from dlama.errors import InputError
from dlama.files.atomic_write import new_directory

COLUMNS = ("held_out", "frames", "method", "region", "modality", "metric", "value")
REGIONS = ("whole", "seen by one", "seen by several", "seen by none")


def evaluate_sequence(dataset: str, output: Path, report: Report, cases: Mapping[str, Any]) -> None:
    """Held-out frames made of 1, 2, 4 and 8 others, and removals: sequence.md and sequence.csv in the directory `output`.

    cases: the options protocol, scenes, layout, camera, depth_range, gamma, removal_object and limit by name.
    """
    from dlama.datasets.posed.view_pairs import NoPairsError
    from dlama.evaluation.protocols.methods import ProtocolSettings
    from dlama.evaluation.protocols.sequence import table
    from dlama.evaluation.protocols.sequence_removal import removal_table
    from dlama.evaluation.protocols.sequence_run import rows_of
    from dlama.worlds.dataset import open_dataset_or_worlds

    if cases["protocol"] != ("sequence",):
        raise InputError("protocol sequence goes alone, it takes other cases than the others")
    with report_result("evaluate", report) as result, counting_bar("sequence", report) as bar:

        def progress(done: int, total: int, name: str) -> None:
            if bar is not None:
                bar(done, total, f"sequence: {name}")

        names = ("layout", "camera", "depth_range", "gamma", "removal_object")
        options = {name: cases[name] for name in names}
        try:
            found = open_dataset_or_worlds(dataset, **options, scenes=cases["scenes"] or None)
        except NoPairsError as error:  # pairs of frames are for the other protocols
            found = Dataset(Path(dataset).name, "", Path(dataset), error.frames, ())
        rows = list(rows_of(found, cases["limit"], ProtocolSettings(), progress))
        parts = [f"**{region}**\n\n{table(rows, region)}" for region in REGIONS]
        removed = [row for row in rows if row.measure.region == "hidden"]
        if removed:
            parts.append(f"**removal, what the object hid**\n\n{removal_table(removed)}")
        with new_directory(output) as folder:
            (folder / "sequence.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
            text = io.StringIO()
            writer = csv.writer(text, lineterminator="\n")
            writer.writerow(COLUMNS)
            writer.writerows([row.held_out, row.frames, row.method, *row.measure] for row in rows)
            (folder / "sequence.csv").write_text(text.getvalue(), encoding="utf-8")
        held = sorted({row.held_out for row in rows if row.measure.region != "hidden"})
        removals = f", {len({row.held_out for row in removed})} removals" if removed else ""
        line = f"{output / 'sequence.md'}: {len(held)} held-out frames of {len(found.frames)}{removals}, {len(rows)} numbers"
        result.add(line, output=str(output), held_out=held)
