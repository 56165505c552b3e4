"""A record in; its file, downloaded, checked and moved into place, out.

Received bytes lie in a .part file next to the target, so that an interrupted pull resumes. The file itself appears under its name
only when it is whole and its hash is right.
"""

from __future__ import annotations

from pathlib import Path

from dlama.errors import FileError, OutputError, system_errors
from dlama.models.cache import describe_manual_install, target_path
from dlama.models.download import Moved, Offline, Progress, Unusable, download
from dlama.models.records import Record
from dlama.models.verify import mismatch, size_and_sha256, verify


def pull(model: Record, progress: Progress | None = None) -> Path:
    """The model's file, from the first mirror that has it; a good file that exists is kept.

    Args:
        model: its record.
        progress: called with the bytes that have arrived and the bytes in all (None: unknown).
    Raises:
        FileError: no mirror gave the right file; lists each failure, and how to download by hand.
        OutputError: the cache directory cannot be written.
    """
    target = target_path(model)
    if target.is_file() and verify(model).state != "wrong":
        return target
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{target.parent}: cannot be made ({error}); DLAMA_MODELS names another directory") from error
    failures: list[tuple[str, Unusable]] = []
    for url in model.urls:
        try:
            return _from_mirror(url, model, target, progress)
        except Unusable as error:
            failures.append((url, error))
    raise FileError(_failure_message(model, failures))


def _from_mirror(url: str, model: Record, target: Path, progress: Progress | None) -> Path:
    """From one mirror; a wrong hash after a resumed download is given one more try from the start."""
    part = target.with_name(target.name + ".part")
    while True:
        # without a hash nothing tells whether the file that is continued is still the same
        resumed = download(url, part, model.bytes, progress, resumes=model.sha256 is not None)
        complaint = mismatch(model, *size_and_sha256(part))
        if not complaint:
            break
        part.unlink()
        if not resumed:
            raise Unusable(complaint)
    with system_errors(OutputError):
        part.replace(target)
    return target


def _failure_message(model: Record, failures: list[tuple[str, Unusable]]) -> str:
    if not failures:
        return f"{model.name}: nobody serves this file. {describe_manual_install(model)}"
    if all(isinstance(error, Offline) for _, error in failures):
        begin = f"{model.name}: no connection; is this machine online?"
    elif all(isinstance(error, Moved) for _, error in failures):
        begin = f"{model.name}: the file has moved away from every known address"
    else:
        begin = f"{model.name}: no mirror gave the right file"
    return f"{begin} [{'; '.join(f'{url}: {error}' for url, error in failures)}]. {describe_manual_install(model)}"
