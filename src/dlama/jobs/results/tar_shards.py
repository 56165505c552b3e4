"""Results in; tar shards of N of them, as the webdataset package reads them, out.

A sample's key is its job's id, its files follow one after the other: `kitchen/0001.image.png`, `kitchen/0001.meta.json`. A key
ends at its first dot, so dots of an id are written %2E (and % as %25).
"""

from __future__ import annotations

import dataclasses
import io
import tarfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from dlama.errors import OutputError, first_line, system_errors
from dlama.jobs.results.manifest import Manifest
from dlama.jobs.results.result import JobResult
from dlama.jobs.storage import Output, open_to_read

FOLDER, STAGED = "shards", "staged/"
"""Below OUT: the shards, and results that wait for theirs."""


def key_of(name: str) -> str:
    """The key of a job's sample."""
    return name.replace("%", "%25").replace(".", "%2E")


def is_shard(folder: str) -> bool:
    """Whether a row's folder is the shard that holds its result."""
    return folder.startswith(f"{FOLDER}/")


@dataclass
class Packer:
    """Takes results as they end and packs each N of them. A result that is packed no longer lies in its folder."""

    output: Output
    manifest: Manifest
    size: int | None
    """None: results stay in their folders, and leave the shards of an earlier run."""
    waiting: list[JobResult] = field(default_factory=list)

    def add(self, row: JobResult) -> None:
        """A result that lies in no shard, of this run or an earlier one; OutputError where the shard that is full now cannot be
        written."""
        if row.status == "done" and (is_shard(row.replaces) if self.size is None else not is_shard(row.folder)):
            self.waiting.append(row)
            if len(self.waiting) == self.size:
                self.pack()

    @system_errors(OutputError)
    def pack(self) -> None:
        """All that wait into one shard. What they replace goes first, from its shard or with its folder; rows follow last."""
        if not self.waiting:
            return
        self._remove_replaced()
        if self.size is None:
            for row in self.waiting:
                self.manifest.add(dataclasses.replace(row, replaces=""))
            self.waiting = []
            return
        name = f"{FOLDER}/{self._next():06d}.tar"
        for row in self.waiting:  # a run that ends before their last rows leaves this shard to be replaced
            self.manifest.add(dataclasses.replace(row, replaces=name))
        self.manifest.send()
        self._write(name, (member for row in self.waiting for member in self._members(row)))
        for row in self.waiting:
            self.manifest.add(dataclasses.replace(row, folder=name, replaces=""))
        for row in self.waiting:
            self._remove(row.folder)
        self.waiting = []

    def _remove_replaced(self) -> None:
        replaced: dict[str, set[str]] = {}
        for row in self.waiting:
            if is_shard(row.replaces):
                replaced.setdefault(row.replaces, set()).add(key_of(row.id))
            elif row.replaces and self.output.has(row.replaces):
                self._remove(row.replaces)
        for shard, keys in replaced.items():
            self._leave_out(shard, keys)

    def _members(self, row: JobResult) -> Iterator[tuple[str, bytes]]:
        """The files of a result; in a shard the folders inside it are part of a file's ending (`right.image.png`)."""
        for name in self.output.names(row.folder):
            with open_to_read(self.output.of(f"{row.folder}/{name}"), "rb") as stream:
                yield f"{key_of(row.id)}.{name.replace('/', '.')}", stream.read()

    def _write(self, name: str, members: Iterable[tuple[str, bytes]]) -> None:
        with (
            self.output.open(name, "wb") as stream,
            tarfile.open(fileobj=stream, mode="w|", format=tarfile.GNU_FORMAT) as shard,
        ):
            for member, content in members:
                about = tarfile.TarInfo(member)
                about.size = len(content)
                shard.addfile(about, io.BytesIO(content))

    def _leave_out(self, shard: str, keys: set[str]) -> None:
        """Write a shard again without these samples; an empty one goes."""
        if not self.output.exists(shard):  # somebody has taken it away
            return
        try:
            with open_to_read(self.output.of(shard), "rb") as stream, tarfile.open(fileobj=stream) as old:
                members = [(one.name, old.extractfile(one)) for one in old.getmembers()]
                kept = [(name, file.read()) for name, file in members if file and _key_in(name) not in keys]
        except tarfile.TarError as error:
            raise OutputError(
                f"{self.output.of(shard)}: is no whole tar file ({first_line(error)}), so results in it cannot be replaced; "
                "remove it, and what it held is run again"
            ) from error
        if kept:
            self._write(shard, kept)
        else:
            self.output.remove(shard)

    def _next(self) -> int:
        """The number after the last shard's."""
        shards = (Path(name) for name in self.output.names(FOLDER))
        return 1 + max((int(one.stem) for one in shards if one.suffix == ".tar" and one.stem.isdigit()), default=-1)

    def _remove(self, result: str) -> None:
        self.output.remove(result)
        if self.output.is_remote:
            return
        for folder in Path(self.output.of(result)).parents:  # of ids with slashes; OUT itself has the manifest
            if folder == Path(self.output.of("")) or any(folder.iterdir()):
                break
            folder.rmdir()


def _key_in(name: str) -> str:
    """The key of a member: up to the first dot of its last part, as webdataset has it."""
    folder, slash, last = name.rpartition("/")
    return f"{folder}{slash}{last.split('.', 1)[0]}"
