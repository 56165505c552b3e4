"""`dlama evaluate`: a data set and methods in, tables and a report out."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional

from dlama.apps.options import Json, Metres, Output, told
from dlama.apps.terminal import say, shown_bar
from dlama.completion.recipes import RECIPES, recipe
from dlama.datasets.frames import Case, Dataset, Protocol
from dlama.errors import InputError, MissingExtraError
from dlama.evaluation.protocols.methods import NO_FILL, Method, ProtocolSettings
from dlama.inpainters import FILLERS

if TYPE_CHECKING:
    from dlama.evaluation.runner.run import Progress, Results

FAILED = 1
"""Exit code where some cases could not be run."""
INTERRUPTED = 130
NEED_MODEL = [name for name, record in FILLERS.items() if record.needs_model]
"""Fillers that run a network."""
NEEDED = {"scikit-image": "skimage", "scipy": "scipy", "matplotlib": "matplotlib", "jinja2": "jinja2"}
YAW_NEAR = 0.5
"""Degrees by which a pair's yaw may differ from the one asked for."""
PROTOCOL_NAMES: tuple[Protocol, ...] = ("vpi", "ori", "sii")


@dataclass(frozen=True)
class Scope:
    """Which cases of the data set are run."""

    protocol: Annotated[tuple[Protocol, ...], told("vpi|ori|sii ...", "(default: all that the data set has)")] = ()
    """View change, object removal, stereo."""
    scenes: Annotated[tuple[str, ...], told("SCENE ...", "(default: all)")] = ()
    """Only these scenes."""
    yaws: Annotated[tuple[float, ...], told("DEG ...", "(default: all)")] = ()
    """Only cases about so many degrees round, to either side; of removal and stereo, which turn nothing, all."""
    limit: Annotated[int | None, told("N", "(default: all)")] = None
    """At most so many cases of each protocol, the first ones."""
    layout: Annotated[str | None, told("NAME", "(default: recognised)")] = None
    """How the data set lies on disk: easysynth, pairs, removal, stereo, tum, 7-scenes, scannet, ..."""
    depth_range: Metres = None
    """EasySynth: metres that 1.0 stands for in its depth files."""
    gamma: Annotated[Literal["srgb", "linear"] | None, told("srgb|linear")] = None
    """EasySynth: how its 8-bit PNG depth is encoded, where there is no better."""
    removal_object: Annotated[str | None, told("NAME|R,G,B", "(default: object)")] = None
    """EasySynth: the semantic class that is taken out."""
    camera: Json = None
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
        has = [name for name in PROTOCOL_NAMES if dataset.of(name)]
        missing = [name for name in self.protocol if name not in has]
        if missing:
            raise InputError(f"{dataset.name} has no cases of {missing[0]}; it has {', '.join(has) or 'none at all'}")
        cases: list[Case] = []
        for name in self.protocol or has:
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
class Contest:
    """Which methods are put to them: every recipe with every filler."""

    recipes: Annotated[tuple[str, ...], told(f"{'|'.join(RECIPES)} ...", "(default: dlama paper)")] = ("dlama", "paper")
    """Whole methods, ours and the paper's as published."""
    fillers: Annotated[tuple[str, ...], told("FILLER ...", "(default: layered telea none)")] = (
        "layered",
        "telea",
        NO_FILL,
    )
    """Of none, layered, telea, navier-stokes, lama, migan, joint; none leaves the holes as they are."""
    model: Annotated[tuple[str, ...], told("FILLER=FILE|NAME ...")] = ()
    """The network of a filler that runs one: an ONNX file, a LaMa checkpoint, or a name of `dlama models list`."""
    seed: Annotated[int, told("N", "(default: 0)")] = 0
    """Fillers and the bootstrap draw from this; the same seed gives the same numbers."""
    variants: Annotated[bool, told("")] = True
    """Leave out the runs with other masks and dilations, and the stereo pairs matched by the method itself."""

    def methods(self) -> list[Method]:
        """Every recipe with every filler. InputError: an unknown name, a network missing or of no use."""
        for name in self.recipes:
            recipe(name)
        models = self.models()
        for filler in self.fillers:
            if filler not in (NO_FILL, *FILLERS):
                raise InputError(f"filler is {filler!r}; one of {', '.join((NO_FILL, *FILLERS))} is wanted")
            if filler in NEED_MODEL and filler not in models:
                raise InputError(f"filler {filler!r} runs a network: --model {filler}=FILE is wanted")
        fillers, recipes = dict.fromkeys(self.fillers), dict.fromkeys(self.recipes)
        return [Method(name, filler, models.get(filler), seed=self.seed) for name in recipes for filler in fillers]

    def models(self) -> dict[str, Path]:
        """Filler -> its ONNX file; a checkpoint is converted once, into the cache."""
        from dlama.apps.model_files import model_for

        found: dict[str, Path] = {}
        for word in self.model:
            filler, equals, file = word.partition("=")
            if not equals or not file or filler not in NEED_MODEL:
                raise InputError(f"--model is {word!r}; FILLER=FILE is wanted, FILLER one of {', '.join(NEED_MODEL)}")
            if filler not in self.fillers:
                raise InputError(f"--model {word} has no use: {filler} is not among --fillers {' '.join(self.fillers)}")
            found[filler] = model_for(file)
        return found

    def settings(self) -> ProtocolSettings:
        """Of the protocols."""
        if self.variants:
            return ProtocolSettings()
        return ProtocolSettings(object_dilations=(), mask_changes=(), matched_stereo=False)


def evaluate(
    dataset: Positional[Annotated[str, told("DATASET")]],
    /,
    output: Output,
    scope: Scope = Scope(),
    contest: Contest = Contest(),
    jobs: Annotated[int, told("N", "(default: 1)")] = 1,
) -> None:
    """Methods measured on frames with ground truth: the paper's tables, and a report. Goes on where it was interrupted.

    Args:
        dataset: The folder of a data set, or worlds[:COUNT[:SEED]] for generated ones.
        output: Directory for report.html, summary.md, summary.json, results.csv, timings.csv, and what a later run takes over.
        jobs: Processes; each computes on one core.
    """
    needs_extra()
    from dlama.evaluation.protocols import PROTOCOLS
    from dlama.evaluation.report.write import write_report
    from dlama.evaluation.runner.run import run

    methods, settings, found = contest.methods(), contest.settings(), scope.open(dataset)
    with shown_progress(found.name) as progress:
        done = run(found.cases, methods, PROTOCOLS, settings, output, jobs=jobs, progress=progress)
    write_report(
        output, found, done, settings, seed=contest.seed, command=command_line(dataset, output, scope, contest)
    )
    print(told_result(done, output))
    if done.failures:
        raise SystemExit(FAILED)


def needs_extra() -> None:
    """MissingExtraError before anything is computed, where the report could not be written in the end."""
    from importlib.util import find_spec

    for package, module in NEEDED.items():
        if find_spec(module) is None:
            raise MissingExtraError("dlama evaluate", package, "evaluate")


def command_line(dataset: str, output: Path, scope: Scope, contest: Contest) -> str:
    """The command that gives these results again; what is as by default is left out."""
    words = ["dlama", "evaluate", dataset]
    for options in (scope, contest):
        for field in dataclasses.fields(options):
            value = getattr(options, field.name)
            if value != field.default:
                words += (
                    [f"--no-{field.name}"] if value is False else [f"--{field.name.replace('_', '-')}", *_words(value)]
                )
    return shlex.join([*words, "-o", str(output)])


def told_result(done: Results, output: Path) -> str:
    """One line: how much was done, how much of it had been there, what failed, where the report lies."""
    kept = f"{done.reused} from an earlier run" if done.reused else ""
    stale = f"{done.stale} done again, as settings, data or dlama had changed" if done.stale else ""
    how = ", ".join(filter(None, (kept, stale)))
    counts = f"{len(done.stored)} results" + (f" ({how})" if how else "")
    failed = f", {len(done.failures)} failed ({output / 'errors.json'})" if done.failures else ""
    return f"{output / 'report.html'}: {counts}{failed}"


@contextmanager
def shown_progress(title: str) -> Iterator[Progress]:
    """A bar on a terminal, a line a minute elsewhere; failures as a line each, at once. Ctrl-C says that nothing is lost."""
    from dlama.evaluation.report.write import failure_line
    from dlama.evaluation.runner.progress import progress_lines

    try:
        with shown_bar(title) as bar, nullcontext() if bar else progress_lines(title) as lines:

            def progress(outcome: Any, done: int, total: int) -> None:
                if outcome is not None and outcome.error:
                    say("error", failure_line(outcome))
                if lines is not None:
                    lines(outcome, done, total)
                if bar is not None:
                    words = f"{title}: {outcome.case.scene} {outcome.case.frame}" if outcome else title
                    bar.update(bar.task_ids[0], completed=done, total=total, description=words)

            yield progress
    except KeyboardInterrupt:
        say("error", "interrupted; what is done is kept, and the same command goes on from there")
        raise SystemExit(INTERRUPTED) from None


def _words(value: Any) -> Sequence[str]:
    return [
        f"{one:g}" if isinstance(one, float) else str(one) for one in (value if isinstance(value, tuple) else [value])
    ]
