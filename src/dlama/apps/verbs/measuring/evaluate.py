"""`dlama evaluate`: a data set and methods in, tables and a report out."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from tyro.conf import Positional

from dlama.apps.options import CameraFile, Metres, Output, Report, Seed, option
from dlama.apps.places import check_folder_apart
from dlama.apps.terminal.output import print_line, report_result
from dlama.apps.terminal.progress import bar_or_lines
from dlama.completion.options import RECIPE_NAMES
from dlama.errors import InputError, MissingExtraError, format_count
from dlama.inpainters import FILLERS
from dlama.workers.progress import progress_line

if TYPE_CHECKING:
    from dlama.datasets.frames import Case, Dataset
    from dlama.evaluation.protocols.methods import Method, ProtocolSettings
    from dlama.evaluation.runner.run import Progress, Results

FAILED = 1
"""Exit code where some cases could not be run."""
NO_FILL = "none"
"""The filler that leaves holes as they are."""
NETWORK_FILLERS = tuple(name for name, record in FILLERS.items() if record.needs_model)
"""Fillers that run a network."""
NEEDED = {"scikit-image": "skimage", "scipy": "scipy", "matplotlib": "matplotlib", "jinja2": "jinja2"}
YAW_NEAR = 0.5
"""Degrees by which a pair's yaw may differ from the one asked for."""
Protocol = Literal["vpi", "ori", "sii", "mask"]


@dataclass(frozen=True)
class Cases:
    """Which cases of the data set are run."""

    protocol: Annotated[
        tuple[Protocol, ...],
        option(
            "vpi|ori|sii|mask ...",
            "vpi ori sii, as the data set has",
            help="View change, object removal, stereo; and how well the removed object's mask is found by clicks and boxes.",
        ),
    ] = ()
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
    gamma: Annotated[Literal["srgb", "linear"] | None, option("srgb|linear", "as the files say")] = None
    """EasySynth: how its 8-bit PNG depth is encoded, where there is no better."""
    removal_object: Annotated[str | None, option("NAME|R,G,B", "object")] = None
    """EasySynth: the semantic class that is removed."""
    camera: CameraFile = None
    """The camera file of a layout that has none of its own (tum, 7-scenes, redwood)."""

    def open(self, path: str) -> Dataset:
        """The data set with those cases only. InputError where none is left, and what `open_dataset` raises."""
        from dlama.worlds.dataset import open_dataset_or_worlds

        found = open_dataset_or_worlds(
            path,
            self.layout,
            depth_range=self.depth_range,
            gamma=self.gamma,
            removal_object=self.removal_object,
            camera=self.camera,
            limit=None if self.yaws else self.limit,
            scenes=self.scenes or None,
        )
        return dataclasses.replace(found, cases=self.chosen(found))

    def chosen(self, dataset: Dataset) -> tuple[Case, ...]:
        """The cases asked for, protocol by protocol."""
        has = [name for name in get_args(Protocol) if dataset.of(name)]
        missing = [name for name in self.protocol if name not in has]
        if missing:
            raise InputError(f"{dataset.name} has no cases of {missing[0]}; it has {', '.join(has) or 'none at all'}")
        cases: list[Case] = []
        for name in self.protocol or [one for one in has if one != "mask"]:
            cases += [case for case in dataset.of(name) if self.has_yaw(case)][: self.limit]
        if not cases:
            known = sorted({abs(case.yaw) for case in dataset.cases if case.yaw is not None})
            raise InputError(
                f"no case is left of {dataset.name}; its yaws are {', '.join(f'±{one:g}' for one in known)}"
            )
        return tuple(cases)

    def has_yaw(self, case: Case) -> bool:
        """Whether --yaws lets the case through; those without a yaw it does not concern."""
        if not self.yaws or case.yaw is None:
            return True
        return any(abs(abs(case.yaw) - abs(yaw)) <= YAW_NEAR for yaw in self.yaws)


@dataclass(frozen=True)
class Methods:
    """Which methods are measured on them: every recipe with every filler."""

    recipes: Annotated[tuple[str, ...], option(f"{'|'.join(RECIPE_NAMES)} ...", "dlama paper")] = ("dlama", "paper")
    """Whole methods, ours and the paper's as published."""
    fillers: Annotated[tuple[str, ...], option("FILLER ...", "layered telea none")] = (
        "layered",
        "telea",
        NO_FILL,
    )
    """Of none (holes stay), layered, layered-patches, telea, lama, migan, patchmatch, choice, joint, pair."""
    model: Annotated[tuple[str, ...], option("FILLER=FILE|NAME ...")] = ()
    """The network of a filler that runs one: an ONNX file, a LaMa checkpoint, or a name of `dlama models list`."""
    seed: Seed = 0
    """Fillers and the bootstrap draw from this; the same seed gives the same numbers."""
    variants: Annotated[bool, option("", "they are run")] = True
    """Leave out the runs with other masks and dilations, and the stereo pairs matched by the method itself."""

    def all(self) -> list[Method]:
        """Every recipe with every filler. InputError: an unknown name, a network missing or of no use."""
        from dlama.evaluation.protocols.methods import Method

        for name in self.recipes:
            if name not in RECIPE_NAMES:
                raise InputError(f"`recipes` is {name!r}; one of {', '.join(RECIPE_NAMES)} is expected")
        models = self.models()
        for filler in self.fillers:
            if filler not in (NO_FILL, *FILLERS):
                raise InputError(f"`fillers` is {filler!r}; one of {', '.join((NO_FILL, *FILLERS))} is expected")
            if filler in NETWORK_FILLERS and FILLERS[filler].shipped is None and filler not in models:
                raise InputError(f"filler {filler!r} runs a network: --model {filler}=FILE is expected")
        fillers, recipes = dict.fromkeys(self.fillers), dict.fromkeys(self.recipes)
        return [Method(name, filler, models.get(filler), seed=self.seed) for name in recipes for filler in fillers]

    def models(self) -> dict[str, Path]:
        """Filler -> its ONNX file; a checkpoint is converted once, into the cache."""
        from dlama.apps.model_files import model_for

        found: dict[str, Path] = {}
        for word in self.model:
            filler, equals, file = word.partition("=")
            if not equals or not file or filler not in NETWORK_FILLERS:
                raise InputError(
                    f"--model is {word!r}; FILLER=FILE is expected, FILLER one of {', '.join(NETWORK_FILLERS)}"
                )
            if filler not in self.fillers:
                raise InputError(f"--model {word} has no use: {filler} is not among --fillers {' '.join(self.fillers)}")
            found[filler] = model_for(file)
        return found

    def settings(self) -> ProtocolSettings:
        """Settings of the protocols."""
        from dlama.evaluation.protocols.methods import ProtocolSettings

        if self.variants:
            return ProtocolSettings()
        return ProtocolSettings(object_dilations=(), mask_changes=(), matched_stereo=False)


def evaluate(
    dataset: Positional[Annotated[str, option("DATASET", None)]],
    /,
    output: Output,
    cases: Cases,
    methods: Methods,
    report: Report,
    jobs: Annotated[int, option("N", "1")] = 1,
) -> None:
    """Methods measured on frames with ground truth: the paper's tables, and a report. Continues where it was interrupted.

    Args:
        dataset: The folder of a data set, a scene.npz, or worlds[:COUNT[:SEED]] for generated ones where no folder is called so.
        output: Directory for report.html, summary.md, summary.json, results.csv, timings.csv, and what a later run takes over.
        jobs: Processes; each computes on one core.
    """
    check_extra()
    check_folder_apart(output, {"data set": dataset, "camera": cases.camera})
    from dlama.evaluation.protocols import PROTOCOLS
    from dlama.evaluation.report.reliability import reliability_lines
    from dlama.evaluation.report.write import write_report
    from dlama.evaluation.runner.run import run

    with report_result("evaluate", report) as result:
        chosen, settings, found = methods.all(), methods.settings(), cases.open(dataset)
        with show_progress(found.name, report) as progress:
            done = run(found.cases, chosen, PROTOCOLS, settings, output, jobs=jobs, progress=progress)
        command = command_line(dataset, output, cases, methods)
        summary = write_report(output, found, done, settings, seed=methods.seed, command=command)
        for line in reliability_lines(summary):
            result.add(line)
        result.add(summary_line(done, output), **summary_values(done, output))
    if done.failures:
        raise SystemExit(FAILED)


def check_extra() -> None:
    """MissingExtraError before anything is computed, where the report could not be written in the end."""
    for package, module in NEEDED.items():
        if find_spec(module) is None:
            raise MissingExtraError("dlama evaluate", package, "evaluate")


def command_line(dataset: str, output: Path, cases: Cases, methods: Methods) -> str:
    """The command that gives these results again; what is as by default is left out."""
    words = ["dlama", "evaluate", dataset]
    for options in (cases, methods):
        for field in dataclasses.fields(options):
            value, flag = getattr(options, field.name), field.name.replace("_", "-")
            if value != field.default:
                words += [f"--no-{flag}"] if value is False else [f"--{flag}", *_words(value)]
    return shlex.join([*words, "-o", str(output)])


def summary_line(done: Results, output: Path) -> str:
    """One line: how much was done, how much of it had been there, what failed, where the report lies."""
    kept = f"{done.reused} from an earlier run" if done.reused else ""
    stale = f"{done.stale} done again, as settings, data or dlama had changed" if done.stale else ""
    how = ", ".join(filter(None, (kept, stale)))
    counts = format_count(len(done.stored), "result") + (f" ({how})" if how else "")
    failed = f", {len(done.failures)} failed ({output / 'errors.json'})" if done.failures else ""
    return f"{output / 'report.html'}: {counts}{failed}"


def summary_values(done: Results, output: Path) -> dict[str, Any]:
    """The same, JSON-ready."""
    counts = {"results": len(done.stored), "reused": done.reused, "stale": done.stale, "failed": len(done.failures)}
    return {"output": str(output), "report": str(output / "report.html"), **counts}


@contextmanager
def show_progress(title: str, report: Report) -> Iterator[Progress]:
    """A bar on a terminal, a line a minute elsewhere; failures as a line each, at once. Ctrl-C prints that nothing is lost."""
    from dlama.evaluation.report.write import failure_line

    state = {"kept": 0, "done": 0, "total": 0, "failed": 0}

    def line(seconds: float) -> str:
        return progress_line(title, seconds=seconds, **state)

    with bar_or_lines(title, report, line) as bar:

        def progress(outcome: Any, done: int, total: int) -> None:
            state.update(done=done, total=total)
            if outcome is None:
                state["kept"] = done
            elif outcome.error:
                state["failed"] += 1
                print_line("error", failure_line(outcome))
            if bar is not None:
                case = f": {outcome.case.scene} {outcome.case.frame}" if outcome else ""
                bar(done, total, f"{title}{case}")

        yield progress


def _words(value: Any) -> Sequence[str]:
    return [
        f"{one:g}" if isinstance(one, float) else str(one) for one in (value if isinstance(value, tuple) else [value])
    ]
