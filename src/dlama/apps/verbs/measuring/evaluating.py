"""A data set and methods, as the options of `dlama evaluate` name them, in; their results stored, and the report, out."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args

from dlama.apps.model_files import model_for
from dlama.apps.options import Report, typed_words
from dlama.apps.terminal.output import FAILED, follow_run, report_result
from dlama.apps.terminal.streams import print_line
from dlama.apps.verbs.measuring.options import NO_FILL, Cases, Methods, Protocol
from dlama.arguments import check_word
from dlama.completion.options import RECIPE_NAMES
from dlama.datasets.frames import Case, Dataset
from dlama.errors import InputError, format_count
from dlama.evaluation.protocols import PROTOCOLS
from dlama.evaluation.protocols.methods import Method, ProtocolSettings
from dlama.evaluation.report.reliability import reliability_lines
from dlama.evaluation.report.summary import is_orbit, own_labels, yaw_order
from dlama.evaluation.report.write import failure_line, headlines, write_report
from dlama.evaluation.runner.run import Progress, Results, run
from dlama.inpainters import FILLERS
from dlama.worlds.dataset import open_dataset_or_worlds

NETWORK_FILLERS = tuple(name for name, record in FILLERS.items() if record.needs_model)
"""Fillers that run a network."""


def open_cases(path: str, cases: Cases) -> Dataset:
    """The data set with those cases only. InputError where none is left, and what `open_dataset` raises."""
    found = open_dataset_or_worlds(
        path,
        cases.layout,
        depth_range=cases.depth_range,
        depth_scale=cases.depth_scale,
        removal_object=cases.removal_object,
        camera=cases.camera,
        limit=None if cases.yaws else cases.limit,
        scenes=cases.scenes or None,
    )
    return dataclasses.replace(found, cases=choose_cases(found, cases))


def choose_cases(dataset: Dataset, cases: Cases) -> tuple[Case, ...]:
    """The cases asked for, protocol by protocol."""
    has = [name for name in get_args(Protocol) if dataset.of(name)]
    missing = [name for name in cases.protocol if name not in has]
    if missing:
        raise InputError(f"{dataset.name} has no cases of {missing[0]}; it has {', '.join(has) or 'none at all'}")
    found: list[Case] = []
    for name in cases.protocol or has:
        of_protocol = dataset.of(name)
        orbit = is_orbit(case.yaw for case in of_protocol)
        found += [case for case in of_protocol if has_yaw(case, cases.yaws, orbit)][: cases.limit]
    if not found:
        raise InputError(f"no case is left of {dataset.name}; its yaws are {', '.join(known_yaws(dataset))}")
    return tuple(found)


def known_yaws(dataset: Dataset) -> list[str]:
    """The yaws of its cases, as the report names them, in order."""
    orbit = is_orbit(case.yaw for case in dataset.cases)
    return sorted({label for case in dataset.cases for label in own_labels(case.yaw, orbit)[:1]}, key=yaw_order)


def has_yaw(case: Case, yaws: Sequence[float], orbit: bool) -> bool:
    """Whether --yaws lets the case through: it is as near as half a degree, or has that name in the report (≈30). Those without
    a yaw it does not concern."""
    if not yaws or case.yaw is None:
        return True
    return any(abs(abs(case.yaw) - abs(yaw)) <= 0.5 or f"≈{abs(yaw):g}" in own_labels(case.yaw, orbit) for yaw in yaws)


def all_methods(methods: Methods) -> list[Method]:
    """Every recipe with every filler. InputError: an unknown name, a network missing or of no use."""
    for name in methods.recipes:
        check_word(name, "recipes", RECIPE_NAMES)
    models = find_models(methods)
    for filler in methods.fillers:
        check_word(filler, "fillers", (NO_FILL, *FILLERS))
        if filler in NETWORK_FILLERS and FILLERS[filler].shipped is None and filler not in models:
            raise InputError(f"filler {filler!r} runs a network: --model {filler}=FILE is expected")
    fillers, recipes = dict.fromkeys(methods.fillers), dict.fromkeys(methods.recipes)
    return [Method(name, filler, models.get(filler), seed=methods.seed) for name in recipes for filler in fillers]


def find_models(methods: Methods) -> dict[str, Path]:
    """Filler -> its ONNX file; a checkpoint is converted once, into the cache."""
    found: dict[str, Path] = {}
    for word in methods.model:
        filler, equals, file = word.partition("=")
        if not equals or not file or filler not in NETWORK_FILLERS:
            raise InputError(
                f"--model is {word!r}; FILLER=FILE is expected, FILLER one of {', '.join(NETWORK_FILLERS)}"
            )
        if filler not in methods.fillers:
            raise InputError(f"--model {word} has no use: {filler} is not among --fillers {' '.join(methods.fillers)}")
        found[filler] = model_for(file)
    return found


def measure_methods(
    dataset: str, output: Path, cases: Cases, methods: Methods, report: Report, jobs: int, pictures: bool
) -> None:
    """Every method on every case, and the report. InputError, OutputError; SystemExit where some could not be run."""
    with report_result("evaluate", report) as result:
        without: Any = {} if methods.variants else {"object_dilations": (), "mask_changes": (), "matched_stereo": False}
        chosen, settings, found = all_methods(methods), ProtocolSettings(**without), open_cases(dataset, cases)
        with show_progress(found.name, report) as progress:
            done = run(
                found.cases, chosen, PROTOCOLS, settings, output, jobs=jobs, pictures=pictures, progress=progress
            )
        command = command_line(dataset, output, cases, methods)
        summary = write_report(output, found, done, settings, seed=methods.seed, command=command)
        for line in (*headlines(summary), *reliability_lines(summary)):
            result.add(line)
        counts = {"results": len(done.stored), "reused": done.reused, "stale": done.stale, "failed": len(done.failures)}
        result.add(summary_line(done, output), output=str(output), report=str(output / "report.html"), **counts)
    if done.failures:
        raise SystemExit(FAILED)


def command_line(dataset: str, output: Path, cases: Cases, methods: Methods) -> str:
    """The command that gives these results again; what is as by default is left out."""
    words = ["dlama", "evaluate", dataset]
    for options in (cases, methods):
        for field in dataclasses.fields(options):
            value, flag = getattr(options, field.name), field.name.replace("_", "-")
            if value != field.default:
                words += [f"--no-{flag}"] if value is False else [f"--{flag}", *typed_words(value)]
    return shlex.join([*words, "-o", str(output)])


def summary_line(done: Results, output: Path) -> str:
    """One line: how much was done, how much of it had been there, what failed, where the report lies."""
    kept = f"{done.reused} from an earlier run" if done.reused else ""
    stale = f"{done.stale} done again, as settings, data or dlama had changed" if done.stale else ""
    how = ", ".join(filter(None, (kept, stale)))
    counts = format_count(len(done.stored), "result") + (f" ({how})" if how else "")
    failed = f", {len(done.failures)} failed ({output / 'errors.json'})" if done.failures else ""
    return f"{output / 'report.html'}: {counts}{failed}"


@contextmanager
def show_progress(title: str, report: Report) -> Iterator[Progress]:
    """A bar on a terminal, a line a minute elsewhere; failures as a line each, at once. Ctrl-C prints that nothing is lost."""
    failed = 0
    with follow_run(title, report, lambda: failed) as update:

        def progress(outcome: Any, done: int, total: int) -> None:
            nonlocal failed
            if outcome is not None and outcome.error:
                failed += 1
                print_line("error", failure_line(outcome))
            update(done, total, f"{outcome.case.scene} {outcome.case.frame}" if outcome else "", outcome is None)

        yield progress
