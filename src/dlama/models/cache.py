"""A model's name in; its file on this disk out.

Files lie flat in one directory: the user's cache directory, or the one that the environment variable DLAMA_MODELS names.
"""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

from dlama.errors import FileError, system_errors
from dlama.models.records import Record, record


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
    urls = " or ".join(model.urls)
    return f"By hand: download {urls} and put it at {target_path(model)}, then `dlama models verify {model.name}`"


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
    if not path.is_file():
        raise FileError(
            f"{path}: the model {name} is not there; get it with `dlama models pull {name}`. {describe_manual_install(model)}"
        )
    if model.bytes is not None and path.stat().st_size != model.bytes:
        raise FileError(
            f"{path}: {path.stat().st_size} bytes, the model {name} has {model.bytes}; "
            f"replace it with `dlama models pull {name}`. {describe_manual_install(model)}"
        )
    return path
