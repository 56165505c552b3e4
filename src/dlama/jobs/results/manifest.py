"""Rows of results in; JSONL shards while a run lasts, manifest.csv at its end, and what earlier runs have done, out.

The shards below OUT/manifest are the truth: one line a result, the last one of an id counts, a line that a killed run left
unfinished is none. A copy of the last rows on disk (SQLite, in a temporary file) keeps the memory the same for any number of
jobs.
"""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import os
import shutil
import sqlite3
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import IO

from dlama.errors import InputError, OutputError, system_errors
from dlama.jobs.job import Job
from dlama.jobs.results.result import CSV_COLUMNS, JobResult
from dlama.jobs.storage import Output, file_stamp, file_system, is_address
from dlama.models.verify import sha256_of
from dlama.writing.atomic_write import writing
from dlama.writing.drafts import lock_output

FOLDER, TABLE = "manifest", "manifest.csv"
SENT_EVERY = 10.0
"""Seconds: object stores cannot append, so the shard under way is sent as a whole."""


class Manifest:
    """What is known of every job. To be closed; a `with` block does it."""

    def __init__(self, output: Output, jobs: Iterable[Job] = (), *, read_only: bool = False) -> None:
        """jobs: those of a list, which are entered before anything is written.

        InputError: as of `plan`. OutputError: the place cannot be written, or another run is writing there.
        """
        self.output = output
        self._temporary = tempfile.TemporaryDirectory(prefix="dlama-manifest-")
        self._index = sqlite3.connect(Path(self._temporary.name, "index.sqlite"), isolation_level=None)
        self._index.executescript(
            "pragma journal_mode=off; pragma synchronous=off;"
            "create table jobs (number integer primary key, id text unique);"
            "create table rows (id text unique, line text);"
        )
        self._index.execute("begin")
        self._shards: list[Path] = []
        self._writer: IO[bytes] | None = None
        self._shard_rows = 0
        self._sent = time.monotonic()
        self._lock = contextlib.ExitStack()
        self._folder = Path(self._temporary.name, FOLDER) if output.is_remote else Path(output.of(FOLDER))
        try:
            for number, job in enumerate(jobs):
                self.plan(number, job)
            if not read_only:
                self._open()
            self._read_shards()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Manifest:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def plan(self, number: int, job: Job) -> None:
        """Enter a job of the list. InputError: another has its id, or an id that is a folder above or below it."""
        name, where = job.id, job.where
        try:
            self._index.execute("insert into jobs values (?, ?)", (number, name))
        except sqlite3.IntegrityError:
            (first,) = self._index.execute("select number from jobs where id = ?", (name,)).fetchone()
            raise InputError(f"{where}: id {name!r} is that of job {first + 1} already; ids must differ") from None
        planned = "select 1 from jobs where id = ?"
        above = [
            str(one) for one in PurePosixPath(name).parents if self._index.execute(planned, (str(one),)).fetchone()
        ]
        below = self._index.execute("select id from jobs where id > ? and id < ? limit 1", (f"{name}/", f"{name}0"))
        others = above or [one for (one,) in below]
        if others:
            raise InputError(f"{where}: id {name!r} and id {others[0]!r}: the folder of one would lie in the other's")

    @property
    def planned(self) -> int:
        """How many jobs were entered."""
        return int(self._index.execute("select count(*) from jobs").fetchone()[0])

    def find(self, name: str) -> JobResult | None:
        """The last row of a job; None: it has none."""
        found = self._index.execute("select line from rows where id = ?", (name,)).fetchone()
        return None if found is None else JobResult.from_json(found[0])

    def find_done(self, job: Job) -> JobResult | None:
        """The row of a job that is done, from the same inputs with the same options, and whose result is there; else None."""
        row, files = self.find(job.id), job.files
        if row is None or (row.status, row.options_hash, set(row.inputs)) != ("done", job.options_hash, set(files)):
            return None
        if not self.output.has(row.folder):
            return None
        row = self._restamp(row, files)
        return None if row is None else dataclasses.replace(row, kept=True)

    def _restamp(self, row: JobResult, files: Mapping[str, str]) -> JobResult | None:
        """The row of inputs that are the same; with the stamps of files that lie elsewhere or were written again. None: one of
        them has other bytes."""
        stamps = {role: file_stamp(path) for role, path in files.items()}
        if all(stamps[role] and stamps[role] == row.inputs[role]["stamp"] for role in files):
            return row
        if any(not _same_bytes(path, row.inputs[role]["sha256"]) for role, path in files.items()):
            return None
        inputs = {role: {**one, "path": files[role], "stamp": stamps[role]} for role, one in row.inputs.items()}
        row = dataclasses.replace(row, inputs=inputs)
        self.add(row)
        return row

    @system_errors(OutputError)
    def add(self, row: JobResult) -> None:
        """Enter a result: from here on it counts. OutputError: it cannot be written."""
        if self._writer is None or self._shard_rows >= 20_000:
            self._new_shard()
        assert self._writer is not None
        line = row.as_json()
        with writing(self._shards[-1]):  # an error names no file
            self._writer.write(line.encode() + b"\n")
            self._writer.flush()
        self._index.execute("insert or replace into rows values (?, ?)", (row.id, line))
        self._shard_rows += 1
        if self.output.is_remote and time.monotonic() - self._sent > SENT_EVERY:
            self.send()

    def rows(self) -> Iterator[JobResult]:
        """One a job: those of the list in its order, then those of other lists by id."""
        listed = "select line from jobs join rows using (id) order by number"
        others = "select line from rows where id not in (select id from jobs) order by id"
        for query in (listed, others):
            for (line,) in self._index.execute(query):
                yield JobResult.from_json(line)

    @system_errors(OutputError)
    def write_table(self) -> str:
        """Write manifest.csv and return its path. OutputError."""
        self.send()
        with self.output.open(TABLE) as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(CSV_COLUMNS)
            writer.writerows(row.csv_row() for row in self.rows())
        return self.output.of(TABLE)

    def close(self) -> None:
        """Write what is still to be written."""
        with contextlib.ExitStack() as stack:
            stack.callback(self._temporary.cleanup)
            stack.callback(self._index.close)
            stack.callback(self._lock.close)
            if self._writer is not None:
                stack.callback(self._writer.close)
            self.send()

    @system_errors(OutputError)
    def _open(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        if self.output.is_remote:
            return
        (self._folder / "lock").touch()
        self._lock.enter_context(lock_output(self._folder / "lock", self.output.place))

    def _read_shards(self) -> None:
        if self.output.is_remote:
            self._fetch()
        for path in sorted(self._folder.glob("*.jsonl")):
            self._shards.append(path)
            with path.open("rb") as stream:
                for line in stream:
                    with contextlib.suppress(ValueError, TypeError, KeyError):
                        row = JobResult.from_json(line.decode())
                        self._index.execute("insert or replace into rows values (?, ?)", (row.id, line.decode()))

    def _fetch(self) -> None:
        system, inside = file_system(self.output.of(FOLDER))
        self._folder.mkdir(parents=True, exist_ok=True)
        if system.exists(inside):
            for one in system.ls(inside, detail=False):
                if one.endswith(".jsonl"):
                    system.get_file(one, str(self._folder / one.rpartition("/")[2]))

    def _new_shard(self) -> None:
        if self._writer is not None:
            self.send()
            self._writer.close()
        last = max((int(path.name[:20]) for path in self._shards if path.name[:20].isdecimal()), default=0)
        number = max(time.time_ns(), last + 1)  # read in this order, also where the clock has gone back
        path = self._folder / f"{number:020d}-{os.getpid()}.jsonl"
        self._writer = path.open("ab")
        self._shards.append(path)
        self._shard_rows = 0

    def send(self) -> None:
        """The shard under way, as a whole, to the object store, where the output is one."""
        if self.output.is_remote and self._shards and self._writer is not None:
            name = f"{FOLDER}/{self._shards[-1].name}"
            with self.output.open(name, "wb") as stream, self._shards[-1].open("rb") as source:
                shutil.copyfileobj(source, stream)
        self._sent = time.monotonic()


def _same_bytes(path: str, sha256: str) -> bool:
    """Whether a file of this computer has that hash; one that lies elsewhere has not, as far as is known."""
    with contextlib.suppress(OSError, InputError):
        return not is_address(path) and sha256_of(Path(path)) == sha256
    return False
