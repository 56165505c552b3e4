"""A result in; its files (a zip, single ones), and the command and the Python lines that make them again, out."""

from __future__ import annotations

import io
import shlex
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import dlama
from dlama.completion.options import options_in
from dlama.files.rasters.images import has_16_bits
from dlama.files.rasters.masks import write_mask
from dlama.files.results.completion import RESULTS, file_names
from dlama.jobs.options import Pointing
from dlama.jobs.parameters import ESTIMATING, LENS, METHOD, MOVE, POINTING, READING, typed
from dlama.web.answers import PageError, hide_paths
from dlama.web.inputs import Source, names_of
from dlama.web.marks import pointing
from dlama.web.visits import Result

OUT = "out"
MASK = "mask.png"
EVERY = tuple(name for name in RESULTS if name != "mask")
"""What can be taken home as single files; the zip has those that the command line writes."""
FILES = {"view": ("image", "depth"), "remove": ("image", "depth", "mask"), "stereo": ("left", "right")}
"""Verb -> its files that have no flag, in their order."""
FLAGS = {name: one.flag for name, one in options_in(Pointing).items() if one.flag}
"""Parameter -> its flag, where that is not its name."""
OF_JOBS = {"clicks": "click", "not_clicks": "not_click"}
"""Parameters of `find_mask` -> those of jobs, which are words one by one."""
AT_DEFAULT: tuple[Any, ...] = ((), None, "object", False)
"""Values of parameters of `find_mask` that say nothing."""


def verb_of(source: Source, masked: bool) -> str:
    """The verb that does it."""
    return "stereo" if source.pair is not None else "remove" if masked else "view"


def needs_mask_file(result: Result) -> bool:
    """Whether the command line takes the mask as a file: painted, grown, or of a stereo pair."""
    return result.mask is not None and not (
        result.source.pair is None and result.marks is not None and result.marks.in_words
    )


def parameters_of(result: Result) -> dict[str, Any]:
    """The parameters of the job that gives the result again, with the visitor's names of the files; those at their defaults are
    left away."""
    source = result.source
    names = {role: upload.name for role, upload in source.files.items()}
    p: dict[str, Any] = {"image" if source.pair is None else "left": names.pop("picture"), **names, **source.options}
    if needs_mask_file(result):
        p["mask"] = MASK
    elif result.mask is not None and result.marks is not None:
        p |= {
            OF_JOBS.get(name, name): value for name, value in pointing(result.marks).items() if value not in AT_DEFAULT
        }
    stays = {"yaw": 0.0} if source.pair is None and result.mask is None else {}
    return p | (dict(result.request.move) or stays) | dict(result.request.method)


def command(result: Result) -> list[str]:
    """The words of the command line."""
    verb, p = verb_of(result.source, result.mask is not None), parameters_of(result)
    words = ["dlama", verb, *(p.pop(role) for role in FILES[verb] if role in p)]
    for name, value in p.items():
        flag, texts = f"--{FLAGS.get(name, name.replace('_', '-'))}", format_values(name, value)
        words += [f"{flag}={texts[0]}"] if texts and texts[0].startswith("-") else [flag, *texts]
    return [*words, "-o", OUT]


def format_values(name: str, value: Any) -> list[str]:
    """A parameter's value as it is typed, word by word."""
    if name == "metres_at":
        return [f"{typed(x)},{typed(y)}={typed(metres)}" for x, y, metres in value]
    if value is True:
        return []
    lists = value if name in OF_JOBS.values() else (value,)
    return [",".join(map(typed, one)) if isinstance(one, (tuple, list)) else typed(one) for one in lists]


def python_lines(result: Result) -> str:
    """The same in Python."""
    p, verb = parameters_of(result), verb_of(result.source, result.mask is not None)
    given = {"stereo": ["left", "right", "rig"], "remove": ["rgbd", "mask"], "view": ["rgbd"]}[verb]
    given += ["mask=mask"] if verb == "stereo" and "mask" in p else []
    masked = []
    if "mask" in p:
        masked = [f"mask = dlama.read_mask({MASK!r})"]
    elif verb == "remove":
        masked = [f"mask = dlama.find_mask({', '.join(['rgbd', *keywords(p, POINTING)])}).mask"]
    moves, method = keywords(p, MOVE), keywords(p, METHOD)
    done = [f"done = dlama.{verb}({', '.join([*given, *([] if verb == 'stereo' else moves), *method])})"]
    if verb == "stereo" and moves:
        done.append(f"done = dlama.view({', '.join(['done.scene', *moves, *method])})")
    plates = plates_of(result.source)
    write = f"dlama.write(done, {OUT!r}{f', inputs={plates!r}' if plates else ''})"
    return "\n".join(["import dlama", "", *reading_lines(p), *masked, *done, write, ""])


def reading_lines(p: Mapping[str, Any]) -> list[str]:
    """How a pair, or a picture and its depth, is read in Python."""
    if "left" in p:
        return [
            f"left, right = dlama.read_color({p['left']!r}), dlama.read_color({p['right']!r})",
            f"rig = dlama.read_stereo_calib({p['calib']!r}, hw=left.shape[:2])",
        ]
    files = [repr(p[role]) for role in ("image", "depth") if role in p]
    return [f"rgbd = dlama.read_rgbd({', '.join([*files, *keywords(p, LENS, READING, ESTIMATING)])})"]


def keywords(p: Mapping[str, Any], *groups: Mapping[str, Any]) -> list[str]:
    """`name=value` of each parameter that is of one of the groups."""
    named = {job: name for name, job in OF_JOBS.items()}
    given = {name: value for name, value in p.items() if any(name in group for group in groups)}
    return [f"{named.get(name, name)}={list(v) if name in named else v!r}" for name, v in given.items()]


def plates_of(source: Source) -> dict[str, str]:
    """Role -> name, of the pictures with 16 bits a channel, which `write` looks at once more."""
    roles = {"picture": "image"} if source.pair is None else {"picture": "left", "right": "right"}
    files = {role: source.files[each] for each, role in roles.items() if each in source.files}
    return {role: upload.name for role, upload in files.items() if has_16_bits(upload.path)}


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
    names = names_of(result.source.files)
    if needs_mask_file(result) and result.mask is not None:
        inputs["mask"] = folder / MASK
        names[folder / MASK] = MASK
        write_mask(folder / MASK, result.mask)
    about = result.source.job.about_inputs()
    if result.object_mask and not needs_mask_file(result):
        about["object_mask"] = result.object_mask
    done = replace(result.done, meta=result.done.meta | about)
    lens_from = hide_paths(result.source.job.intrinsics_from, names)
    seconds = result.source.job.stages
    shown = {role: names[Path(path)] for role, path in inputs.items()}
    how_read: dict[str, Any] = {"intrinsics_from": lens_from, "seconds": seconds, "input_addresses": shown}
    return dlama.write(done, folder / OUT, only=only, inputs=inputs, **how_read)


def zip_result(result: Result, parent: Path) -> bytes:
    """The files of the command line, the mask where it reads one, and commands.txt with how to do it again."""
    stream = io.BytesIO()
    with tempfile.TemporaryDirectory(dir=parent) as name:
        out = write_result(result, Path(name))
        with zipfile.ZipFile(stream, "w") as archive:
            for path in sorted(each for each in out.rglob("*") if each.is_file()):
                kind = zipfile.ZIP_DEFLATED if path.suffix in (".json", ".txt") else zipfile.ZIP_STORED
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
