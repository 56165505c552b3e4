"""A result in; its files (a zip, single ones), and the command and the Python lines that make them again, out."""

from __future__ import annotations

import io
import json
import shlex
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import dlama
from dlama.files.rasters.images import has_16_bits
from dlama.files.rasters.pictures import write_mask
from dlama.files.results.completion import RESULTS, file_names
from dlama.files.results.meta_json import as_json
from dlama.files.scenes.photo3d_page import photo3d_page
from dlama.web.answers import PageError, hide_paths
from dlama.web.completions.request import CompletionRequest
from dlama.web.inputs import Source
from dlama.web.marks import Marks, pointing
from dlama.web.visits import Result

OUT = "out"
MASK = "mask.png"
EVERY = tuple(name for name in RESULTS if name != "mask")
"""What can be taken home as single files; the zip has those that the command line writes."""
PACKED = (".json", ".txt")
"""Endings that a zip makes smaller."""


def verb_of(source: Source, masked: bool) -> str:
    """The verb that does it."""
    return "stereo" if source.pair is not None else "remove" if masked else "view"


def needs_mask_file(result: Result) -> bool:
    """Whether the command line takes the mask as a file: painted, grown, or of a stereo pair."""
    return result.mask is not None and not (
        result.source.pair is None and result.marks is not None and result.marks.in_words
    )


def command(result: Result) -> list[str]:
    """The words of the command line."""
    source, files = result.source, {role: upload.name for role, upload in result.source.files.items()}
    verb = verb_of(source, result.mask is not None)
    words = ["dlama", verb, files["picture"]]
    if verb == "stereo":
        words += [files["right"], "--calib", files["calib"]]
        words += ["--mask", MASK] if result.mask is not None else []
    else:
        words += [files["depth"]] if "depth" in files else []
        words += [MASK] if needs_mask_file(result) else []
        words += ["--camera", files["camera"]] if "camera" in files else []
        words += option_words(source.options)
        if result.mask is not None and not needs_mask_file(result) and result.marks is not None:
            words += marks_words(result.marks)
        words += move_words(result.request, needed=verb == "view")
    return [*words, *option_words(result.request.method), "-o", OUT]


def option_words(options: Mapping[str, Any]) -> list[str]:
    """Keyword arguments as flags."""
    words = []
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if name == "metres_at":
            words += [flag, *(f"{x:g},{y:g}={metres:g}" for x, y, metres in value)]
        else:
            words += [flag, format_value(value)]
    return words


def format_value(value: Any) -> str:
    """A value as it is typed."""
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)


def marks_words(marks: Marks) -> list[str]:
    """Clicks and a box as flags."""
    words = []
    for flag, points in (("--click", marks.clicks), ("--not", marks.not_clicks)):
        if points:
            words += [flag, *(",".join(map(format_value, one)) for one in points)]
    if marks.box:
        words.append(f"--box={','.join(map(format_value, marks.box))}")
    if marks.candidate != "object":
        words += ["--candidate", marks.candidate]
    return [*words, "--with-shadow"] if marks.with_shadow else words


def move_words(request: CompletionRequest, needed: bool) -> list[str]:
    """The camera's move as flags; `needed`: at least one."""
    moves = {"yaw": request.yaw, "pitch": request.pitch, "dolly": request.dolly}
    words = [f"--{name}={format_value(value)}" for name, value in moves.items() if value]
    if not words and needed:
        words = ["--yaw=0"]
    return [*words, f"--pivot={format_value(request.pivot)}"] if words and request.pivot != "auto" else words


def python_lines(result: Result) -> str:
    """The same in Python."""
    source, files = result.source, {role: upload.name for role, upload in result.source.files.items()}
    lines = ["import dlama", ""]
    method = keywords(result.request.method)
    if source.pair is not None:
        lines += [
            f"left, right = dlama.read_color({files['picture']!r}), dlama.read_color({files['right']!r})",
            f"rig = dlama.read_stereo_calib({files['calib']!r}, hw=left.shape[:2])",
        ]
        masked = [f"mask=dlama.read_mask({MASK!r})"] if result.mask is not None else []
        lines.append(f"done = dlama.stereo({', '.join(['left', 'right', 'rig', *masked, *method])})")
    else:
        lens = [f"camera={files['camera']!r}"] if "camera" in files else []
        given = [repr(files[role]) for role in ("picture", "depth") if role in files]
        lines.append(f"rgbd = dlama.read_rgbd({', '.join([*given, *lens, *keywords(source.options)])})")
        move = keywords({name: value for name, value in result.request.move.items() if name == "pivot" or value})
        move = [word for word in move if word != "pivot='auto'"]
        if result.mask is None:
            lines.append(f"done = dlama.view({', '.join(['rgbd', *move, *method])})")
        else:
            lines += mask_lines(result)
            lines.append(f"done = dlama.remove({', '.join(['rgbd', 'mask', *move, *method])})")
    plates = plates_of(source)
    return "\n".join([*lines, f"dlama.write(done, {OUT!r}{f', inputs={plates!r}' if plates else ''})", ""])


def plates_of(source: Source) -> dict[str, str]:
    """Role -> name, of the pictures with 16 bits a channel, which `write` looks at once more."""
    roles = {"picture": "image"} if source.pair is None else {"picture": "left", "right": "right"}
    files = {role: source.files[each] for each, role in roles.items() if each in source.files}
    return {role: upload.name for role, upload in files.items() if has_16_bits(upload.path)}


def mask_lines(result: Result) -> list[str]:
    """How the mask comes about in Python."""
    if needs_mask_file(result) or result.marks is None:
        return [f"mask = dlama.read_mask({MASK!r})"]
    empty: tuple[Any, ...] = ((), None, "object", False)
    words = keywords({name: value for name, value in pointing(result.marks).items() if value not in empty})
    return [f"mask = dlama.find_mask({', '.join(['rgbd', *words])}).mask"]


def keywords(options: Mapping[str, Any]) -> list[str]:
    """`name=value` of each."""
    return [f"{name}={list(value) if name in ('clicks', 'not_clicks') else value!r}" for name, value in options.items()]


def how(result: Result) -> dict[str, Any]:
    """For the page: the command line, the Python lines, and which file they read that the zip brings."""
    return {
        "command": shlex.join(command(result)),
        "python": python_lines(result),
        "mask_file": MASK if needs_mask_file(result) else "",
        "files": file_names(result.done, EVERY),
    }


def write_result(result: Result, folder: Path, only: tuple[str, ...] | None = None) -> Path:
    """Write a result as the command line does, to `folder`/out; with the mask next to it where the command reads one."""
    inputs = dict(result.source.job.inputs)
    names = {upload.path: upload.name for upload in result.source.files.values()}
    if needs_mask_file(result) and result.mask is not None:
        inputs["mask"] = folder / MASK
        names[folder / MASK] = MASK
        write_mask(folder / MASK, result.mask)
    if result.object_mask and not needs_mask_file(result):
        result.done.meta["object_mask"] = result.object_mask
    lens_from = hide_paths(result.source.job.intrinsics_from, names)
    seconds = result.source.job.stages
    out = dlama.write(result.done, folder / OUT, only=only, inputs=inputs, intrinsics_from=lens_from, seconds=seconds)
    meta = json.loads((out / "meta.json").read_text("utf-8"))
    for entry in meta["inputs"].values():
        entry["path"] = names[Path(entry["path"])]
    (out / "meta.json").write_text(as_json(meta), encoding="utf-8")
    return out


def zip_result(result: Result, parent: Path) -> bytes:
    """The files of the command line, the mask where it reads one, and commands.txt with how to do it again."""
    stream = io.BytesIO()
    with tempfile.TemporaryDirectory(dir=parent) as name:
        out = write_result(result, Path(name))
        with zipfile.ZipFile(stream, "w") as archive:
            for path in sorted(each for each in out.rglob("*") if each.is_file()):
                kind = zipfile.ZIP_DEFLATED if path.suffix in PACKED else zipfile.ZIP_STORED
                archive.write(path, f"{OUT}/{path.relative_to(out).as_posix()}", kind, compresslevel=1)
            if needs_mask_file(result):
                archive.write(Path(name) / MASK, MASK)
            archive.writestr("commands.txt", f"{shlex.join(command(result))}\n\n{python_lines(result)}")
    return stream.getvalue()


def single_file(result: Result, file: str, parent: Path) -> bytes:
    """One file of the result. PageError for a name that it has not."""
    if file not in file_names(result.done, EVERY):
        raise PageError(f"{file[:40]!r} is no file of this result")
    group = next((name for name, files in RESULTS.items() if file.rpartition("/")[2] in files), "preview")
    with tempfile.TemporaryDirectory(dir=parent) as name:
        return (write_result(result, Path(name), (group,)) / file).read_bytes()


def photo3d_html(result: Result) -> bytes:
    """The 3-D photo as one HTML file."""
    photo, parts = result.photo
    return photo3d_page(photo.box, parts).encode()
