"""A run directory: settings.json, data.json, metrics.csv, log.txt, sheets/, last.ckpt, and at the end the network.

Rows and lines in -> files out. Only the first process of a run writes.
"""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from dlama.errors import FileError, InputError, OutputError, any_error, system_errors
from dlama.files.fields import json_text, json_value
from dlama.training.presets import PRESETS, settings_of
from dlama.training.settings import TrainSettings
from dlama.workers.progress import log_messages
from dlama.writing.atomic_write import new_file, write_file, writing
from dlama.writing.drafts import lock

SETTINGS, METRICS, LOG_FILE, SHEETS, LAST = "settings.json", "metrics.csv", "log.txt", "sheets", "last.ckpt"
DATA = "data.json"
"""A list of the folders that samples are made of."""
MAY_CHANGE = {
    "loop": {"steps", "log_every", "validate_every", "sheet_every", "checkpoint_every", "accelerator"},
    "data": {"workers"},
}
"""Settings that may differ in a resumed run; all others would make it another run."""


def choose_settings(
    name: str,
    start: Path | None,
    run: Path | None = None,
    mixture: Sequence[str] = (),
    **loop: Any,
) -> TrainSettings:
    """A file's or a preset's settings with what the command line gives put in; InputError.

    mixture: words KIND=SHARE. run: directory of a run to resume: one that began with the same preset keeps what the
    command line gave then, one of a settings file the weights to start from, where neither names others.
    """
    found = settings_of(name)
    if run is not None and (run / SETTINGS).is_file():
        begun = settings_of(run / SETTINGS)
        if name in PRESETS and begun.name == found.name:
            found = begun
        if found.network.start is None:
            found = replace(found, network=replace(found.network, start=begun.network.start))
    if start is not None:
        found = replace(found, network=replace(found.network, start=str(start)))
    if mixture:
        found = replace(found, data=replace(found.data, mixture=_shares(mixture)))
    changes = {key: value for key, value in loop.items() if value is not None}
    return replace(found, loop=replace(found.loop, **changes))


def _shares(words: Sequence[str]) -> dict[str, float]:
    """Kind of sample -> its share, of words KIND=SHARE. InputError."""
    found: dict[str, float] = {}
    for word in words:
        kind, _, share = word.partition("=")
        try:
            found[kind] = float(share)
        except ValueError:
            raise InputError(f"`mixture` has {word!r}; KIND=SHARE is expected, as {kind or 'frame'}=0.5") from None
    return found


def prepare(run: Path, settings: TrainSettings, resume: bool) -> None:
    """Make the directory, or check that the run in it can be resumed with these settings.

    Raises:
        OutputError: there is a run already (`holds_run`) and `resume` was not given, or the directory cannot be made.
        InputError: `resume`, and the settings are not those of the run.
        FileError: `resume`, and there is no run.
    """
    path = run / SETTINGS
    with system_errors(OutputError):
        if resume:
            if not path.is_file():
                raise FileError(f"{run}: holds no {SETTINGS}, so there is no run to resume")
            refuse_changes(settings_of(path), settings)
        elif holds_run(run):
            raise OutputError(f"{run}: holds a run already; give `resume` to continue it, or choose another directory")
        run.mkdir(parents=True, exist_ok=True)


def holds_run(run: Path) -> bool:
    """Whether a directory holds anything of a run that is worth keeping: a checkpoint or a network.

    A run that was killed before its first checkpoint has none of them: it begins anew, resumed or not.
    """
    return (run / LAST).exists() or any(run.glob("*.onnx"))


@contextmanager
def lock_run(run: Path) -> Iterator[None]:
    """While this is open no other process can train in the directory. OutputError where one does."""
    with lock(run) as free:
        if not free:
            raise OutputError(f"{run}: another process trains there")
        yield


def write_data(run: Path, data: Sequence[Path]) -> None:
    """Write the folders that samples are made of, for `read_data`. OutputError."""
    write_file(run / DATA, json.dumps([str(path.absolute()) for path in data], indent=2, ensure_ascii=False) + "\n")


def read_data(run: Path) -> list[Path]:
    """The folders that a run began with. FileError."""
    path = run / DATA
    found = json_value(str(path), json_text(path))
    if not isinstance(found, list) or not all(isinstance(one, str) for one in found):
        raise FileError(f"{path}: is {found!r}; a list of folders is expected")
    return [Path(one) for one in found]


@contextmanager
def log_to_file(run: Path) -> Iterator[None]:
    """While it is open, what the training logs is also written to the run's log.txt; a full disk does not end a run.

    A run that is refused before its settings are written leaves neither the file nor an empty folder.
    """
    path = run / LOG_FILE
    made = not path.exists()
    with writing(path):
        path.touch()

    def write(message: str) -> None:
        with suppress(OSError), path.open("a", encoding="utf-8") as stream:
            stream.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {message}\n")

    try:
        with log_messages(write):
            yield
    finally:
        if made and not (run / SETTINGS).exists():
            with suppress(OSError):  # the folder holds other files
                path.unlink()
                run.rmdir()


def refuse_changes(before: TrainSettings, now: TrainSettings) -> None:
    """InputError naming the first setting that would make it another run."""
    for group in ("network", "loss", "optimiser", "data", "loop"):
        old, new = vars(getattr(before, group)), vars(getattr(now, group))
        for name in old:
            if old[name] != new[name] and name not in MAY_CHANGE.get(group, ()):
                raise InputError(f"`{group}.{name}` is {new[name]!r}, the run to resume has {old[name]!r}")


class MetricsTable:
    """metrics.csv, to which rows are appended.

    columns: behind step, samples and seconds; step: the run begins after it, rows of later steps are removed, since these steps
    are done again. FileError where a table is there that cannot be read.
    """

    def __init__(self, run: Path, columns: Sequence[str], step: int) -> None:
        self.path, self.columns = run / METRICS, ["step", "samples", "seconds", *columns]
        rows = _table(self.path) if self.path.is_file() and step else []
        kept = [row for row in rows if row["step"].isdigit() and int(row["step"]) <= step]
        with new_file(self.path) as draft, draft.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.DictWriter(stream, self.columns, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(kept)

    def add(self, values: Mapping[str, Any]) -> None:
        """Append one row; columns without a value stay empty. OutputError."""
        row = {name: f"{value:.6g}" if isinstance(value, float) else value for name, value in values.items()}
        with writing(self.path), self.path.open("a", encoding="utf-8", newline="") as stream:
            csv.DictWriter(stream, self.columns).writerow(row)


def _table(path: Path) -> list[dict[str, str]]:
    """Rows of a metrics.csv, every cell a text. FileError where it cannot be read or has no steps."""
    with any_error(FileError, f"{path}: cannot be read as a table"), path.open(encoding="utf-8", newline="") as stream:
        reader = csv.DictReader(stream, restval="")
        names = reader.fieldnames or ()
        rows = [{name: text for name, text in row.items() if isinstance(name, str)} for row in reader]
    if "step" not in names:
        raise FileError(f"{path}: is damaged: it has no column `step`")
    return rows
