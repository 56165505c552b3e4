"""A run directory: settings.json, metrics.csv, log.txt, tensorboard/, sheets/, last.ckpt, and at the end the network.

Rows, lines and pictures in -> files out. Only the first process of a run writes.
"""

from __future__ import annotations

import csv
import io
import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dlama.errors import FileError, InputError, OutputError
from dlama.files.atomic_write import new_file
from dlama.training.settings import TrainSettings
from dlama.training.settings_files import from_json, to_json

LOG = logging.getLogger("dlama")
SETTINGS, METRICS, LOG_FILE, SHEETS = "settings.json", "metrics.csv", "log.txt", "sheets"
MAY_CHANGE = {
    "loop": {"steps", "log_every", "validate_every", "sheet_every", "checkpoint_every", "guard_every", "accelerator"},
    "data": {"workers"},
}
"""Settings that a run may be resumed with other values of; all others would make it another run."""


def prepare(run: Path, settings: TrainSettings, resume: bool) -> None:
    """Make the directory, or check that the run in it is the one to go on with.

    Raises:
        OutputError: there is a run already and `resume` was not said, or the directory cannot be made.
        InputError: `resume`, and the settings are not those of the run.
        FileError: `resume`, and there is no run.
    """
    path = run / SETTINGS
    if resume:
        if not path.is_file():
            raise FileError(f"{run}: holds no {SETTINGS}, so there is no run to resume")
        refuse_changes(from_json(path.read_text("utf-8"), str(path)), settings)
    elif path.exists():
        raise OutputError(f"{run}: holds a run already; --resume continues it, or choose another directory")
    try:
        run.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{run}: cannot be made ({error})") from error


def keep_settings(run: Path, settings: TrainSettings) -> None:
    """From now on the directory holds a run. OutputError."""
    with new_file(run / SETTINGS) as draft:
        draft.write_text(to_json(settings), "utf-8")


@contextmanager
def logged(run: Path) -> Iterator[None]:
    """What the training logs, from the choice of samples to the last step, goes into the run's log.txt as well."""
    handler, level = logging.FileHandler(run / LOG_FILE, encoding="utf-8"), LOG.level
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%Y-%m-%d %H:%M:%S"))
    LOG.addHandler(handler)
    LOG.setLevel(min(LOG.getEffectiveLevel(), logging.INFO))
    try:
        yield
    finally:
        LOG.removeHandler(handler)
        LOG.setLevel(level)
        handler.close()


def refuse_changes(had: TrainSettings, now: TrainSettings) -> None:
    """InputError naming the first setting that would make it another run."""
    for room in ("network", "loss", "optimiser", "data", "loop"):
        before, after = vars(getattr(had, room)), vars(getattr(now, room))
        for name in before:
            if before[name] != after[name] and name not in MAY_CHANGE.get(room, ()):
                raise InputError(f"{room}.{name} is {after[name]!r}, the run to resume has {before[name]!r}")


class RunFiles:
    """Open files of a run. `columns` are those of metrics.csv besides step, samples and seconds."""

    def __init__(self, run: Path, columns: Sequence[str], step: int) -> None:
        self.run = run
        self.columns = ["step", "samples", "seconds", *columns]
        self._cut(step)
        self.board = _board(run, step)

    def row(self, values: Mapping[str, Any]) -> None:
        """Append one row of metrics.csv and the same to TensorBoard; columns without a value stay empty."""
        text = io.StringIO()
        writer = csv.DictWriter(text, self.columns)
        writer.writerow({name: f"{v:.6g}" if isinstance(v, float) else v for name, v in values.items()})
        with (self.run / METRICS).open("a", encoding="utf-8", newline="") as stream:
            stream.write(text.getvalue())
        for name, value in values.items():
            if self.board is not None and name != "step":
                self.board.add_scalar(name, value, values["step"])

    def sheet_path(self, step: int) -> Path:
        """Where the sample sheet of that step goes."""
        return self.run / SHEETS / f"step-{step:07d}.png"

    def close(self) -> None:
        """Flush everything."""
        if self.board is not None:
            self.board.close()

    def _cut(self, step: int) -> None:
        """The header, and of an interrupted run the rows up to the checkpoint: what came after is done again."""
        path, kept = self.run / METRICS, []
        if path.is_file() and step:
            with path.open(encoding="utf-8", newline="") as stream:
                kept = [row for row in csv.DictReader(stream) if row["step"].isdigit() and int(row["step"]) <= step]
        with new_file(path) as draft, draft.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.DictWriter(stream, self.columns, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(kept)


def read_metrics(run: Path) -> list[dict[str, float]]:
    """The rows of metrics.csv, empty cells left out."""
    with (run / METRICS).open(encoding="utf-8", newline="") as stream:
        return [{name: float(text) for name, text in row.items() if text} for row in csv.DictReader(stream)]


def _board(run: Path, step: int) -> Any:
    """TensorBoard's writer; where it is not installed the log says so, and metrics.csv has the same numbers."""
    try:
        import tensorboard  # noqa: F401
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        LOG.info(
            "no TensorBoard files are written, since it is not installed (pip install tensorboard); metrics.csv is"
        )
        return None
    return SummaryWriter(str(run / "tensorboard"), purge_step=step + 1 if step else None)
