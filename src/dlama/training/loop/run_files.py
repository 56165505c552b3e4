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
from dlama.training.presets import from_json, to_json
from dlama.training.settings import TrainSettings

LOG = logging.getLogger("dlama")
SETTINGS, METRICS, LOG_FILE, SHEETS = "settings.json", "metrics.csv", "log.txt", "sheets"
MAY_CHANGE = {
    "loop": {"steps", "log_every", "validate_every", "sheet_every", "checkpoint_every", "guard_every", "accelerator"},
    "data": {"workers"},
}
"""Settings that may differ in a resumed run; all others would make it another run."""


def prepare(run: Path, settings: TrainSettings, resume: bool) -> None:
    """Make the directory, or check that the run in it can be resumed with these settings.

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
        raise OutputError(f"{run}: holds a run already; give `resume` to continue it, or choose another directory")
    try:
        run.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{run}: cannot be made ({error})") from error


def write_settings(run: Path, settings: TrainSettings) -> None:
    """Write settings.json, by which a directory is known to hold a run. OutputError."""
    with new_file(run / SETTINGS) as draft:
        draft.write_text(to_json(settings), "utf-8")


@contextmanager
def logged(run: Path) -> Iterator[None]:
    """While it is open, what the training logs is also written to the run's log.txt."""
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


def refuse_changes(before: TrainSettings, now: TrainSettings) -> None:
    """InputError naming the first setting that would make it another run."""
    for group in ("network", "loss", "optimiser", "data", "loop"):
        old, new = vars(getattr(before, group)), vars(getattr(now, group))
        for name in old:
            if old[name] != new[name] and name not in MAY_CHANGE.get(group, ()):
                raise InputError(f"{group}.{name} is {new[name]!r}, the run to resume has {old[name]!r}")


class RunFiles:
    """Files of a run that rows are appended to.

    columns: of metrics.csv, behind step, samples and seconds; step: the run begins after it, rows of later steps are removed.
    """

    def __init__(self, run: Path, columns: Sequence[str], step: int) -> None:
        self.run = run
        self.columns = ["step", "samples", "seconds", *columns]
        self._begin_metrics(step)
        self.tensorboard = _tensorboard(run, step)

    def row(self, values: Mapping[str, Any]) -> None:
        """Append one row of metrics.csv and the same to TensorBoard; columns without a value stay empty."""
        text = io.StringIO()
        writer = csv.DictWriter(text, self.columns)
        writer.writerow({name: f"{v:.6g}" if isinstance(v, float) else v for name, v in values.items()})
        with (self.run / METRICS).open("a", encoding="utf-8", newline="") as stream:
            stream.write(text.getvalue())
        for name, value in values.items():
            if self.tensorboard is not None and name != "step":
                self.tensorboard.add_scalar(name, value, values["step"])

    def sheet_path(self, step: int) -> Path:
        """Where the sample sheet of that step goes."""
        return self.run / SHEETS / f"step-{step:07d}.png"

    def close(self) -> None:
        """Flush everything."""
        if self.tensorboard is not None:
            self.tensorboard.close()

    def _begin_metrics(self, step: int) -> None:
        """Write the header, and the rows of an interrupted run up to its checkpoint: the steps after it are done again."""
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


def _tensorboard(run: Path, step: int) -> Any:
    """TensorBoard's writer; None where it is not installed, which is logged: metrics.csv has the same numbers."""
    try:
        import tensorboard  # noqa: F401
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        LOG.info(
            "no TensorBoard files are written, since it is not installed (pip install tensorboard); metrics.csv is"
        )
        return None
    return SummaryWriter(str(run / "tensorboard"), purge_step=step + 1 if step else None)
