"""A visit and what its page sent in; what the page gets back out. ACTIONS, at the end, is the closed list of addresses.

Every action is a function (visit, fields) -> JSON-ready values or bytes. No field is ever taken for a path.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from typing import Any

import dlama
from dlama.errors import DlamaError
from dlama.web import pictures
from dlama.web.answers import Blob, Fields, Limits, PageError, hide_paths, use_page_words
from dlama.web.completions import results
from dlama.web.completions.runs import warnings_of_thread
from dlama.web.form import describe_form, read_request
from dlama.web.inputs import ROLES, Upload, check_upload, file_name, pixel_of, read_source
from dlama.web.marks import find, mask_of, pointing, read_marks
from dlama.web.visits import Visit

EXAMPLES: dict[str, tuple[str, dict[str, str], dict[str, Any]]] = {
    "street": ("Street", {"picture": "street.jpg", "depth": "depth.png", "camera": "camera.json"}, {}),
    "photo": ("Photo alone", {"picture": "street.jpg"}, {"fov": 90, "camera_height": 1.6}),
    "pair": ("Stereo pair", {"picture": "street.jpg", "right": "right.jpg", "calib": "calib.txt"}, {}),
}
"""Name -> what the page calls it, role -> file of the example that ships, fields that go with it."""


def settings(limits: Limits) -> dict[str, Any]:
    """What the page must know before anything is handed in."""
    return {
        "version": dlama.__version__,
        "limits": {"bytes": limits.bytes, "pixels": int(limits.megapixels * 1e6)},
        "roles": {role: list(endings) for role, endings in ROLES.items()},
        "form": describe_form(),
        "examples": {name: title for name, (title, _, _) in EXAMPLES.items()},
    }


def keep_upload(visit: Visit, role: str, name: str, limits: Limits, write: Callable[[Any], None]) -> dict[str, Any]:
    """Put an uploaded file into the visit's folder, in place of an earlier one; `write` writes it to an open file.

    PageError: it is not taken, the earlier one stays.
    """
    clean, suffix = file_name(name, role, visit.files)
    draft = Upload(clean, visit.folder / f"new-{role}{suffix}")
    upload = Upload(clean, visit.folder / f"{role}{suffix}")
    with visit.lock:
        try:
            with draft.path.open("wb") as file:
                write(file)
            with warnings_of_thread():  # they are shown when it is read
                check_upload(draft, int(limits.megapixels * 1e6), role)
        except BaseException as error:
            draft.path.unlink(missing_ok=True)
            if isinstance(error, DlamaError) and not isinstance(error, PageError):
                raise PageError(hide_paths(error.marked, {draft.path: clean}), role) from error
            raise
        forget_file(visit, role)
        draft.path.replace(upload.path)
        visit.files[role] = upload
    return {"role": role, "name": clean}


def forget_file(visit: Visit, role: str) -> None:
    """Drop an upload and all that came of it."""
    visit.forget_source()
    old = visit.files.pop(role, None)
    if old is not None:
        old.path.unlink(missing_ok=True)


def state(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Where the visit stands, for a page that is loaded again."""
    files = {role: visit.files[role].name for role in ROLES if role in visit.files}
    answer: dict[str, Any] = {"files": files, "fields": visit.fields}
    if visit.source is not None:
        answer |= {"source": describe_source(visit), "warnings": visit.warnings}
        answer |= {"marks": visit.listed, "marked": visit.marked}
    if visit.run is not None and visit.run.state != "cancelled":  # done or failed: the page has not asked since
        answer["run"] = visit.run.progress()
    if visit.result is not None:
        answer["result"] = results.describe_result(visit.result)
    return answer


def forget(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Take an upload back; `role`."""
    forget_file(visit, str(fields.get("role")))
    return state(visit, fields)


def start_over(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Forget everything of the visit."""
    visit.forget_source()
    for role in list(visit.files):
        forget_file(visit, role)
    visit.fields = {}
    return state(visit, fields)


def example(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Take one of the examples that ship; `name`."""
    name = str(fields.get("name"))
    if name not in EXAMPLES:
        raise PageError(f"name is {name[:20]!r}; one of {', '.join(EXAMPLES)} is expected")
    start_over(visit, {})
    _, files, fields_of_example = EXAMPLES[name]
    for role, file in files.items():
        place = visit.folder / f"{role}{(dlama.example() / file).suffix}"
        shutil.copyfile(dlama.example() / file, place)
        visit.files[role] = Upload(file, place)
    return read(visit, fields_of_example)


def read(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Read the uploads, with the fields next to them."""
    visit.forget_source()
    visit.fields = {
        name: value for name, value in fields.items() if isinstance(value, (str, int, float)) and len(str(value)) < 400
    }
    with warnings_of_thread() as warned:
        visit.source = read_source(visit.files, visit.fields)
    visit.warnings = [use_page_words(hide_paths(text, visit.names())) for text in warned]
    return state(visit, fields)


def describe_source(visit: Visit) -> dict[str, Any]:
    """What was read, for the page."""
    source = visit.require_source()
    width, height = source.rgbd.camera.wh
    names = visit.names()
    return {
        "width": width,
        "height": height,
        "facts": {name: hide_paths(text, names) for name, text in source.facts.items()},
        "pair": source.pair is not None,
        "estimated": source.rgbd.estimate is not None,
    }


def source_picture(visit: Visit, fields: Fields) -> Blob:
    """The picture, or with `kind` depth its depth in colours, or right."""
    source = visit.require_source()
    kind = fields.get("kind")
    if kind == "depth":
        shown_depth, ramp = pictures.source_depth(source.rgbd)
        return pictures.png(shown_depth, {"X-Ramp": json.dumps(ramp)})
    if kind == "right" and source.pair is not None:
        return pictures.png(source.pair[1])
    return pictures.png(source.rgbd.color)


def source_pixel(visit: Visit, fields: Fields) -> dict[str, Any]:
    """What a pixel of the source holds; `x`, `y`."""
    view = dlama.View.from_rgbd(visit.require_source().rgbd)
    return pictures.pixel(view, *pixel_of(fields))


def mark(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Everything that is marked: `marks`, `with_shadow`, `candidate`, `grow`. The mask itself is fetched by `mask`."""
    source = visit.require_source()
    marks = read_marks(fields)
    key = tuple(map(str, pointing(marks).values()))
    if visit.found is None or visit.found[0] != key:
        visit.session = visit.session or dlama.MaskSession(source.rgbd)
        visit.found = key, find(visit.session, marks)
    found = visit.found[1]
    mask = mask_of(source.rgbd.depth.shape, marks, found)
    if marks.any and not mask.any():
        raise PageError("nothing is left of the mask; grow it, or paint", "marks")
    visit.marks, visit.mask = marks, mask if mask.any() else None
    visit.listed = list(fields.get("marks") or [])
    visit.preview.clear()
    about: dict[str, Any] = {"candidates": [], "chosen": "", "notes": []}
    if found is not None:
        about = {"candidates": list(found.candidates), "chosen": found.chosen, "notes": list(found.notes)}
    visit.marked = {"share": float(mask.mean()), **about}
    return visit.marked


def mask(visit: Visit, fields: Fields) -> Blob:
    """The mask as a picture, 255 = remove."""
    source = visit.require_source()
    chosen = visit.mask if visit.mask is not None else source.rgbd.missing & False
    return pictures.png(chosen.astype("uint8") * 255)


def preview(visit: Visit, fields: Fields) -> Blob:
    """256 pixels of what is known from where the camera is to stand; the rows of its legend in a header."""
    source = visit.require_source()
    request = read_request(fields)
    if "small" not in visit.preview:
        visit.preview["small"] = pictures.Preview(source.rgbd, visit.mask)
    picture, rows = visit.preview["small"].show(request.move)
    return pictures.png(picture, {"X-Holes": json.dumps(rows)})


def alive(visit: Visit, fields: Fields) -> dict[str, Any]:
    """A sign of life."""
    return {}


ACTIONS: dict[str, Callable[[Visit, Fields], dict[str, Any] | Blob]] = {
    "state": state,
    "alive": alive,
    "forget": forget,
    "start_over": start_over,
    "example": example,
    "read": read,
    "source": source_picture,
    "source_pixel": source_pixel,
    "mark": mark,
    "mask": mask,
    "preview": preview,
    "complete": results.complete,
    "turn": results.turn,
    "run": results.run,
    "cancel": results.cancel,
    "picture": results.picture,
    "pixel": results.pixel,
    "scene": results.scene,
    "photo3d": results.photo3d,
    "zip": results.package,
    "file": results.file,
}
"""Last part of the address -> what it does."""
UNLOCKED = ("alive", "run", "cancel", "preview")
"""Actions that need not wait for another one of the same visit."""
