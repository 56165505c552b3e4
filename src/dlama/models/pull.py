"""A record in; its file, downloaded, checked and moved into place, out.

Received bytes lie in a .part file next to the target, so that an interrupted pull resumes. The file
itself appears under its name only when it is whole and its hash is right.
"""

from __future__ import annotations

import shutil
import zipfile
import zlib
from pathlib import Path

from dlama.errors import FileError, OutputError, system_errors
from dlama.models.cache import PINS, describe_manual_install, known_size_and_sha256, pin, target_path
from dlama.models.download import LONGEST, Progress, Unusable, download
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
    if target.is_file() and verify(model).state in ("verified", "pinned"):
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
    """From one mirror; a wrong hash after a resumed download is given one more try from the start.

    It resumes where the hash, or the checksum of a ZIP's entry, tells whether the pieces are of one file.
    """
    part = target.with_name(target.name + (".zip.part" if model.member else ".part"))
    while True:
        resumed = download(url, part, model.bytes, progress, resume=bool(model.sha256 or model.member))
        complaint = mismatch(*size_and_sha256(part), model.bytes, model.sha256)
        if not complaint:
            break
        part.unlink()
        if not resumed:
            raise Unusable(complaint)
    try:
        return _install(_unpack(part, model, target) if model.member else part, model, target)
    finally:
        part.unlink(missing_ok=True)


def _install(part: Path, model: Record, target: Path) -> Path:
    """Compare with what was pinned, move into place, pin what was not."""
    size, digest = size_and_sha256(part)
    known_size, known = known_size_and_sha256(model)
    complaint = mismatch(size, digest, known_size, known)
    if complaint:
        part.unlink()
        raise Unusable(f"{complaint} (pinned when it was first used; remove its entry in {PINS} to take the new one)")
    with system_errors(OutputError):
        part.replace(target)
    if known is None:
        pin(model, digest, size)
    return target


def _unpack(archive: Path, model: Record, target: Path) -> Path:
    """The one entry of the ZIP that is kept, next to the target; its checksum is compared by the reader."""
    part = target.with_name(target.name + ".part")
    try:
        with zipfile.ZipFile(archive) as opened:
            found = [info for info in opened.infolist() if info.filename.endswith(str(model.member))]
            if len(found) != 1 or found[0].file_size > LONGEST:
                raise Unusable(f"a ZIP with {len(found)} entries */{model.member}, expected one of at most 4 GB")
            with opened.open(found[0]) as source, part.open("wb") as sink:
                shutil.copyfileobj(source, sink, 1 << 20)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, EOFError, RuntimeError) as error:
        part.unlink(missing_ok=True)
        raise Unusable(f"no ZIP archive that can be read ({error})") from error
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OutputError(f"{part}: cannot be written ({error})") from error
    return part


def _failure_message(model: Record, failures: list[tuple[str, Unusable]]) -> str:
    if not failures:
        return f"{model.name}: nobody serves this file. {describe_manual_install(model)}"
    reasons = "; ".join(f"{url}: {error}" for url, error in failures)
    return f"{model.name}: no mirror gave the right file [{reasons}]. {describe_manual_install(model)}"
