"""A batch's folder in; OUT/report.html out: throughput over time, failures in groups, random results and the worst.

Any number of rows: they are gone through once.
"""

from __future__ import annotations

import base64
import io
import random
import re
import tarfile
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from PIL import Image

from dlama.errors import FileError
from dlama.evaluation.report.templates import template
from dlama.jobs.results.manifest import FOLDER, Manifest
from dlama.jobs.results.result import JobResult, Totals
from dlama.jobs.results.tar_shards import key_of
from dlama.jobs.storage import Output, is_address, local_path, open_to_read
from dlama.workers.progress import duration
from dlama.writing.atomic_write import PathLike

THUMBNAIL = 420
"""Pixels of a shown picture's longer side."""
PICTURES = ("preview.png", "image.png")
"""What is shown of a result: the first of these that it has. A preview has source, hole and result side by side."""
SHOWN = 12
"""Pictures of one contact sheet."""
EXAMPLES = 3
"""Jobs that are named of each group of failures."""
BARS = 48
"""Bars of the throughput, at most."""
PLACE = re.compile(r"(?:\w+://|[A-Za-z]:)?[^\s:;,']*[/\\][^\s:;,']*")
NUMBER = re.compile(r"\d+(?:\.\d+)?")


@dataclass
class Group:
    """Failures that say the same, but for names and numbers."""

    kind: str
    message: str
    """Names of files as FILE, numbers as N."""
    count: int = 0
    examples: list[JobResult] = field(default_factory=list)


@dataclass
class Summary(Totals):
    """What the page shows."""

    groups: dict[tuple[str, str], Group] = field(default_factory=dict)
    """(kind, message without names) -> the failures that say it."""
    hosts: Counter[str] = field(default_factory=Counter)
    """Name -> results that ended there, failed ones too."""
    finished: Counter[int] = field(default_factory=Counter)
    """Second -> results that ended in it."""
    at_random: list[JobResult] = field(default_factory=list)
    """SHOWN results, each as likely as any other."""
    largest_holes: list[JobResult] = field(default_factory=list)
    """The SHOWN results with the largest holes, the largest first."""
    most_moves: list[JobResult] = field(default_factory=list)
    """The SHOWN with most filled pixels that were moved behind what was measured, the most first."""


def summarise(rows: Iterable[JobResult], seed: int = 0) -> Summary:
    """One pass over the rows; the random ones are drawn by reservoir, so that each result is as likely as any other."""
    found, draw = Summary(), random.Random(seed)
    for row in rows:
        found.add(row)
        found.finished[int(row.finished)] += 1
        found.hosts.update([row.host] if row.host else [])
        if row.status == "failed":
            _add_failure(found, row)
            continue
        if len(found.at_random) < SHOWN:
            found.at_random.append(row)
        elif (place := draw.randrange(found.done)) < SHOWN:
            found.at_random[place] = row
        for kept, name in ((found.largest_holes, "hole_share"), (found.most_moves, "law_moves")):
            if getattr(row, name):
                kept.append(row)
                kept.sort(key=lambda one, name=name: (getattr(one, name), one.id), reverse=True)  # type: ignore[misc]
                del kept[SHOWN:]
    return found


def without_names(message: str) -> str:
    """A message with FILE for names of files and N for numbers, so that messages of one cause are equal."""
    return NUMBER.sub("N", PLACE.sub("FILE", message))


def throughput(finished: dict[int, int]) -> tuple[int, list[tuple[int, int]]]:
    """Width of a bar in seconds, and (its first second, results that ended in it), idle times between them too, BARS at most."""
    first, last = min(finished, default=0), max(finished, default=-1)
    width = max(0, last - first) // BARS + 1
    counts = dict.fromkeys(range(first, last + 1, width), 0)
    for second, count in finished.items():
        counts[first + (second - first) // width * width] += count
    return width, list(counts.items())


def _add_failure(found: Summary, row: JobResult) -> None:
    key = row.error_kind, without_names(row.error)
    group = found.groups.setdefault(key, Group(*key))
    group.count += 1
    if len(group.examples) < EXAMPLES:
        group.examples.append(row)


def write_report(out: PathLike) -> str:
    """Write OUT/report.html, which loads nothing else, and return its path.

    Raises:
        FileError: there is no batch.
        OutputError: the page cannot be written.
        MissingExtraError: jinja2 is not installed.
    """
    place = str(out)
    output = Output(place)
    if not output.names(FOLDER):
        raise FileError(f"{place}: holds no results of `dlama batch`; there is no folder {FOLDER} in it")
    page = template("batch.html", "batch")
    with Manifest(output, read_only=True) as manifest:
        found = summarise(manifest.rows())
    with output.open("report.html") as stream:
        stream.write(page.render(**values(found, output)))
    return output.of("report.html")


def values(found: Summary, output: Output) -> dict[str, Any]:
    """What the template takes."""
    width, bars = throughput(found.finished)
    begun, ended = min(found.finished, default=0), max(found.finished, default=0)
    facts = [
        *found.facts(),
        ("first and last result", f"{_clock(begun)} to {_clock(ended)} UTC, {duration(ended - begun)}"),
        ("hosts", ", ".join(f"{host} ({count})" for host, count in sorted(found.hosts.items()))),
    ]
    sheets = [
        ("At random", "drawn from all results", _sheet(found.at_random, output)),
        ("Largest holes", "the largest share of the picture was unknown", _sheet(found.largest_holes, output)),
        ("Most law moves", "most filled pixels had to be moved", _sheet(found.most_moves, output)),
    ]
    return {
        "title": f"Batch {Path(local_path(output.place)).name or output.place}",
        "facts": [(name, text) for name, text in facts if text],
        "groups": sorted(found.groups.values(), key=lambda one: (-one.count, one.kind, one.message)),
        "failed": found.failed,
        "bars": _bars(width, bars),
        "bar_width": duration(width),
        "most": max((count for _, count in bars), default=0),
        "begin": _clock(bars[0][0]) if bars else "",
        "end": _clock(bars[-1][0] + width) if bars else "",
        "sheets": [sheet for sheet in sheets if sheet[2]],
    }


def _bars(width: int, bars: list[tuple[int, int]]) -> list[dict[str, Any]]:
    """x, width and height of each bar in a box of 100 x 100, and what it says."""
    most = max((count for _, count in bars), default=1) or 1
    step = 100 / max(len(bars), 1)
    return [
        {
            "x": round(number * step, 3),
            "width": round(0.86 * step, 3),
            "height": round(100 * count / most, 2),
            "label": f"{_clock(start)}: {count} results in {duration(width)}",
        }
        for number, (start, count) in enumerate(bars)
    ]


def _sheet(rows: Iterable[JobResult], output: Output) -> list[dict[str, str]]:
    """Name, caption, folder (from the page; empty: it lies elsewhere) and picture of each result."""
    shown = []
    for row in rows:
        parts = [row.verb]
        parts += [] if row.hole_share is None else [f"{row.hole_share:.1%} unknown"]
        parts += [f"{row.law_moves} moved"] if row.law_moves else []
        link = "" if is_address(output.place) else row.folder
        shown.append({"name": row.id, "caption": ", ".join(parts), "link": link, "picture": _picture(row, output)})
    return shown


def _picture(row: JobResult, output: Output) -> str:
    """A small JPEG of a result as a data URL; empty where it has no picture or is gone."""
    for name in PICTURES:
        try:
            with Image.open(io.BytesIO(_read(row, name, output))) as picture:
                small = picture.convert("RGB")
        except (OSError, KeyError, FileError, tarfile.TarError):  # gone, or damaged
            continue
        small.thumbnail((THUMBNAIL, THUMBNAIL), Image.Resampling.LANCZOS)
        buffer = io.BytesIO()
        small.save(buffer, "JPEG", quality=85)
        return f"data:image/jpeg;base64,{base64.b64encode(buffer.getvalue()).decode()}"
    return ""


def _read(row: JobResult, name: str, output: Output) -> bytes:
    """A file of a result: of its folder, or of its tar shard. OSError, KeyError or FileError where there is none."""
    if not row.folder.endswith(".tar"):
        with open_to_read(output.of(f"{row.folder}/{name}"), "rb") as stream:
            return bytes(stream.read())
    with open_to_read(output.of(row.folder), "rb") as stream, tarfile.open(fileobj=stream) as shard:
        member = shard.extractfile(f"{key_of(row.id)}.{name}")
        return member.read() if member else b""


def _clock(second: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(second))
