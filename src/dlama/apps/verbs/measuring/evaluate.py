"""`dlama evaluate`: a data set and methods in, tables and a report out."""

from __future__ import annotations

from typing import Annotated

from tyro.conf import Positional

from dlama.apps.options import Output, Report, option
from dlama.apps.places import check_folder_apart
from dlama.apps.verbs.measuring.options import Cases, Methods
from dlama.errors import require_extra

NEEDED = {"scikit-image": "skimage", "scipy": "scipy", "jinja2": "jinja2"}


def evaluate(
    dataset: Positional[Annotated[str, option("DATASET", None)]],
    /,
    output: Output,
    cases: Cases,
    methods: Methods,
    report: Report,
    jobs: Annotated[int, option("N", "1")] = 1,
    pictures: Annotated[bool, option("", "off")] = False,
) -> None:
    """Methods measured on frames with ground truth: the paper's tables, and a report. Continues where it was interrupted.

    Args:
        dataset: The folder of a data set, a scene.npz, or worlds[:COUNT[:SEED]] for generated ones where no folder is called so.
        output: Directory for report.html, summary.md, summary.json, results.csv, timings.csv, and what a later run takes over.
        jobs: Processes; each computes on one core.
        pictures: Keep each completed picture (PNG) and its depth (EXR, metres) in pictures/, for figures and metrics of your own.
    """
    require_extra("dlama evaluate", "evaluate", NEEDED)  # before anything is computed
    check_folder_apart(output, {"data set": dataset, "camera": cases.camera})
    from dlama.apps.verbs.measuring.evaluating import measure_methods

    measure_methods(dataset, output, cases, methods, report, jobs, pictures)
