"""A row of a job list in; a Job out: checked parameters, paths resolved, and the hash of its options."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dlama import __version__
from dlama.errors import InputError, first_line
from dlama.jobs.parameters import EXCLUDED, FILES, KNOWN, NETWORKS, VERBS, check_parameters
from dlama.jobs.storage import local_path
from dlama.models.verify import sha256_while_unchanged

RESERVED = ("manifest", "manifest.csv", "report.html", "shards", "staged")
"""What lies in OUT besides the results."""
COLUMNS = ("id", "verb")


@dataclass(frozen=True)
class Job:
    """One job: what to do with which files."""

    id: str
    """Names it, and its folder below OUT; may hold slashes."""
    verb: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Checked values; files as whole paths or addresses."""
    where: str = ""
    """Where it stands, for messages: `jobs.csv: line 7`."""
    error: str | None = None
    """Why it cannot be run; None: it can."""
    load: Callable[[], Any] | None = None
    """Reads the inputs of a job that names no files: a frame or a case of a data set. Picklable."""
    load_hash: str = ""
    """Of what `load` will read."""

    @property
    def files(self) -> dict[str, str]:
        """Role -> path or address of the input files."""
        return {role: str(self.parameters[role]) for role in FILES if role in self.parameters}

    @property
    def options_hash(self) -> str:
        """16 hexadecimal digits of all that decides about the result besides the bytes of its input files."""
        options = {name: value for name, value in self.parameters.items() if name not in FILES}
        options |= {name: _network_hash(options[name]) for name in NETWORKS if name in options}
        parts = [__version__, self.verb, sorted(self.files), sorted(options.items()), self.load_hash]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def job_of(row: Mapping[str, Any], defaults: Mapping[str, Any], base: str, where: str, verb: str | None = None) -> Job:
    """The job of a row. What is wrong with its parameters becomes its `error`; InputError: its id can name no folder.

    Args:
        row: `id`, `verb` and parameters; empty values and names that begin with _ count as not there.
        defaults: parameters of every job whose verb takes them.
        base: what relative paths of the row start from.
        where: for messages.
        verb: of rows without one.
    """
    given = {name: value for name, value in row.items() if not (is_empty(value) or str(name).startswith("_"))}
    name = check_id(str(given.pop("id", "")), where)
    called = str(given.pop("verb", verb or ""))
    try:
        if not called:
            raise InputError(f"`verb` is missing; one of {', '.join(VERBS)} is expected, in the list or as `verb=NAME`")
        own = set(VERBS.get(called, ())).difference(*(EXCLUDED.get(key, ()) for key in given))
        values = check_parameters(called, {key: value for key, value in defaults.items() if key in own} | given)
    except InputError as error:
        return Job(name, called, where=where, error=f"{where}: {first_line(error)}")
    for role in {*FILES, *NETWORKS} & given.keys():
        values[role] = resolve_path(values[role], base, role in FILES)
    return Job(name, called, values, where)


def is_empty(value: object) -> bool:
    """Whether a cell of a list is empty."""
    return isinstance(value, str | None) and not value


def check_id(name: str, where: str) -> str:
    """An id that can name a folder below OUT; raises InputError."""
    if not name:
        raise InputError(f"{where}: id is missing; every job needs one of its own")
    parts = name.split("/")
    if any(part in ("", ".", "..") or part != part.strip() for part in parts) or re.search(
        r'[\\:*?"<>|\x00-\x1f\ud800-\udfff]', name
    ):
        raise InputError(f"{where}: id is {name!r}; a name that can be a folder is expected, such as kitchen/0001")
    if parts[0] in RESERVED or parts[0].startswith("."):
        raise InputError(f"{where}: id is {name!r}; {', '.join(RESERVED)} and hidden names are taken")
    return name


def resolve_path(path: str, base: str, always: bool) -> str:
    """A path of a list, from the list's folder; `always` False: only where there is such a file, as it may be a name."""
    path = local_path(path)
    if "://" in path or Path(path).is_absolute():
        return path
    whole = f"{base.rstrip('/')}/{path}" if "://" in base else str(Path(base, path))
    return whole if always or Path(whole).is_file() else path


def check_columns(names: list[str], where: str) -> None:
    """InputError for a table without `id`, or with a column that no verb knows."""
    if "id" not in names:
        columns = (
            f"there is no column id; the columns are {', '.join(names)}" if names else "is empty; columns are expected"
        )
        raise InputError(f"{where}: {columns}")
    unknown = [name for name in names if name not in COLUMNS + KNOWN and not name.startswith("_")]
    if unknown:
        raise InputError(
            f"{where}: column {unknown[0]!r} is no parameter; known are {', '.join(COLUMNS + KNOWN)}; "
            "a column whose name begins with _ is a note"
        )


def _network_hash(model: str) -> str:
    """Of a network file its bytes; a name stays."""
    return sha256_while_unchanged(Path(model)) if Path(model).is_file() else model
