"""A model's name in; its file on this disk out, and the hashes that were pinned when a file was first used.

Files lie flat in one directory: the user's cache directory, or the one that the environment variable DLAMA_MODELS names.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import platformdirs

from dlama.errors import FileError, system_errors
from dlama.models.records import Record, record
from dlama.writing.atomic_write import write_file

PINS = "pins.json"


def user_path(path: str | Path) -> Path:
    """The path, a `~` at its beginning being the user's home; FileError where that is not known."""
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise FileError(f"{path}: no home folder is known that '~' could be; write the whole path") from error


def directory() -> Path:
    """Where model files lie; need not exist yet."""
    named = os.environ.get("DLAMA_MODELS")
    return user_path(named) if named else Path(platformdirs.user_cache_dir("dlama", appauthor=False)) / "models"


def target_path(model: Record) -> Path:
    """Where that model's file lies, or would."""
    return directory() / model.file


def describe_manual_install(model: Record) -> str:
    """What to do where the network does not help, as one sentence."""
    download = f"By hand: download {' or '.join(model.urls)} and put it at {target_path(model)}"
    return f"{download}, then `dlama models verify {model.name}`"


@system_errors(FileError)
def locate(name: str) -> Path:
    """The file of that model.

    Its size is compared with what is known, its content is not read: `verify` does that.

    Raises:
        InputError: no such name in the catalogue.
        FileError: the file is not there, or it has another size.
    """
    model = record(name)
    path = target_path(model)
    pull = f"`dlama models pull {name}`. {describe_manual_install(model)}"
    if not path.is_file():
        raise FileError(f"{path}: the model {name} is not there; get it with {pull}")
    size, held = known_size_and_sha256(model)[0], path.stat().st_size
    if size is not None and held != size:
        raise FileError(f"{path}: {held} bytes, the model {name} has {size}; replace it with {pull}")
    return path


def known_size_and_sha256(model: Record) -> tuple[int | None, str | None]:
    """Bytes and sha256 of the file as it lies on the disk: the record's, else those pinned on first use, else None."""
    pinned = read_pins().get(model.file, {}) if None in (model.bytes, model.sha256) else {}
    size, sha256 = model.bytes or pinned.get("bytes"), model.sha256 or pinned.get("sha256")
    return size if isinstance(size, int) else None, sha256 if isinstance(sha256, str) else None


def pin(model: Record, sha256: str, size: int) -> None:
    """Remember what a file was when it was first used; OutputError where that cannot be written down."""
    path = directory() / PINS
    text = json.dumps(read_pins() | {model.file: {"sha256": sha256, "bytes": size}}, indent=1, sort_keys=True)
    write_file(path, text + "\n")


def read_pins() -> dict[str, dict[str, object]]:
    """File name -> sha256 and bytes, of every file that was pinned; FileError where the list is damaged."""
    path = directory() / PINS
    try:
        pins = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as error:
        raise FileError(f"{path}: cannot be read ({error}); remove it to pin every file anew") from error
    if not isinstance(pins, dict) or not all(isinstance(entry, dict) for entry in pins.values()):
        raise FileError(f"{path}: expected a table of file names; remove it to pin every file anew")
    return pins
