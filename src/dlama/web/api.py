"""A visit and what its page sent in; what the page gets back out. ACTIONS, at the foot, is the closed list of addresses.

Every action is a function (visit, fields) -> JSON-ready values or bytes. No field is ever taken for a path.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import dlama
from dlama.web import pictures, take_home
from dlama.web.failures import PageError
from dlama.web.inputs import ROLES, Upload, check_size, file_name, number, read_source
from dlama.web.listening import listening
from dlama.web.marks import find, mask_of, others, pointing, read_marks
from dlama.web.runs import Run
from dlama.web.visits import Result, Visit
from dlama.web.wishes import PAGE_FILLERS, RECIPES, read_wish

Fields = Mapping[str, Any]
EXPECTED_STAGES = {"view": 4, "remove": 4, "stereo": 6}
"""What a completion logs."""
EXAMPLES: dict[str, tuple[str, dict[str, str], dict[str, Any]]] = {
    "street": ("Street", {"picture": "street.jpg", "depth": "depth.png", "camera": "camera.json"}, {}),
    "photo": ("Photo alone", {"picture": "street.jpg"}, {"fov": 90, "camera_height": 1.6}),
    "pair": ("Stereo pair", {"picture": "street.jpg", "right": "right.jpg", "calib": "calib.txt"}, {}),
}
"""Name -> what the page calls it, role -> file of the example that ships, fields that go with it."""


@dataclass(frozen=True)
class Blob:
    """Bytes that are no JSON."""

    data: bytes
    kind: str
    """Media type."""
    name: str = ""
    """What a download of it is called."""
    headers: Mapping[str, str] | None = None


@dataclass(frozen=True)
class Limits:
    """What the page takes."""

    megabytes: int = 64
    """Of one file."""
    megapixels: float = 16.0
    """Of one picture."""
    visits: int = 8
    """Pages open at once."""

    @property
    def bytes(self) -> int:
        """Of one file."""
        return self.megabytes * 2**20


def settings(limits: Limits) -> dict[str, Any]:
    """What the page must know before anything is handed in."""
    return {
        "version": dlama.__version__,
        "limits": {"bytes": limits.bytes, "pixels": int(limits.megapixels * 1e6)},
        "roles": {role: list(endings) for role, endings in ROLES.items()},
        "fillers": list(PAGE_FILLERS),
        "recipes": list(RECIPES),
        "examples": {name: title for name, (title, _, _) in EXAMPLES.items()},
    }


def keep_upload(visit: Visit, role: str, name: str, limits: Limits, write: Callable[[Any], None]) -> dict[str, Any]:
    """Put an uploaded file into the visit's folder; `write` writes it to an open file. PageError."""
    clean, suffix = file_name(name, role, visit.files)
    upload = Upload(clean, visit.folder / f"{role}{suffix}")
    with visit.lock:
        forget_file(visit, role)
        try:
            with upload.path.open("wb") as file:
                write(file)
            check_size(upload, int(limits.megapixels * 1e6), role)
        except BaseException:
            upload.path.unlink(missing_ok=True)
            raise
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
    told: dict[str, Any] = {
        "files": {role: upload.name for role, upload in visit.files.items()},
        "fields": visit.fields,
    }
    if visit.source is not None:
        told |= {"source": described(visit), "marks": visit.listed, "masked": visit.mask is not None}
    if visit.run is not None and visit.run.active:
        told["run"] = visit.run.progress()
    if visit.result is not None:
        told["result"] = told_result(visit.result)
    return told


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
        raise PageError(f"name is {name[:20]!r}; one of {', '.join(EXAMPLES)} is wanted")
    start_over(visit, {})
    _, files, beside = EXAMPLES[name]
    for role, file in files.items():
        place = visit.folder / f"{role}{(dlama.example() / file).suffix}"
        shutil.copyfile(dlama.example() / file, place)
        visit.files[role] = Upload(file, place)
    return read(visit, beside)


def read(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Read the uploads, with the fields beside them."""
    visit.forget_source()
    visit.fields = {
        name: value for name, value in fields.items() if isinstance(value, (str, int, float)) and len(str(value)) < 400
    }
    with listening() as warned:
        visit.source = read_source(visit.files, visit.fields)
    return {**state(visit, fields), "warnings": warned}


def described(visit: Visit) -> dict[str, Any]:
    """What was read, for the page."""
    source = visit.needed_source()
    width, height = source.rgbd.camera.wh
    names = visit.names()
    return {
        "width": width,
        "height": height,
        "facts": {name: take_home.shown(text, names) for name, text in source.facts.items()},
        "pair": source.pair is not None,
        "estimated": source.rgbd.estimate is not None,
    }


def source_picture(visit: Visit, fields: Fields) -> Blob:
    """The picture, or with `kind` depth its depth in colours, or right."""
    source = visit.needed_source()
    kind = fields.get("kind")
    if kind == "depth":
        return Blob(pictures.png(pictures.source_depth(source.rgbd)[0]), "image/png")
    if kind == "right" and source.pair is not None:
        return Blob(pictures.png(source.pair[1]), "image/png")
    return Blob(pictures.png(source.rgbd.color), "image/png")


def source_pixel(visit: Visit, fields: Fields) -> dict[str, Any]:
    """What a pixel of the source holds; `x`, `y`."""
    view = dlama.View.from_rgbd(visit.needed_source().rgbd)
    return pictures.pixel(view, *pixel_of(fields))


def pixel_of(fields: Fields) -> tuple[int, int]:
    """Column and row."""
    return int(number("x", fields.get("x"), "")), int(number("y", fields.get("y"), ""))


def mark(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Everything that is marked: `marks`, `with_shadow`, `candidate`, `grow`. The mask itself is fetched by `mask`."""
    source = visit.needed_source()
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
    return {
        "share": float(mask.mean()),
        "candidates": list(others(found)),
        "chosen": found.chosen if found else "",
        "notes": list(found.notes) if found else [],
        "shadow": float(found.shadow.mean()) if found and found.shadow is not None else None,
    }


def mask(visit: Visit, fields: Fields) -> Blob:
    """The mask as a picture, 255 = remove."""
    source = visit.needed_source()
    chosen = visit.mask if visit.mask is not None else source.rgbd.missing & False
    return Blob(pictures.mask_png(chosen), "image/png")


def preview(visit: Visit, fields: Fields) -> Blob:
    """256 pixels of what is known from where the camera is to stand; shares of the hole types in a header."""
    source = visit.needed_source()
    wish = read_wish(fields)
    if "small" not in visit.preview:
        visit.preview["small"] = pictures.Preview(source.rgbd, visit.mask)
    picture, shares = visit.preview["small"].show(wish)
    told = ", ".join(f"{name}={share}" for name, share in shares.items())
    return Blob(pictures.png(picture), "image/png", headers={"X-Holes": told})


def complete(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Begin the completion; `run` tells how far it is."""
    source, mask, marks = visit.needed_source(), visit.mask, visit.marks
    wish = read_wish(fields)
    wish.camera(source.rgbd)
    if visit.run is not None and visit.run.active:
        raise PageError("a completion is under way; cancel it first")
    found = visit.found[1] if visit.found else None
    about: dict[str, Any] = {}
    if mask is not None and found is not None and marks.in_words and source.pair is None:
        told = {"masker": found.masker, "candidate": found.chosen, "notes": list(found.notes)}
        about = {**pointing(marks), "mask_model": None, **told}

    def work() -> dlama.Completion:
        if source.pair is not None:
            return dlama.stereo(*source.pair, mask=mask, **wish.method)
        if mask is None:
            return dlama.view(source.rgbd, **wish.move, **wish.method)
        return dlama.remove(source.rgbd, mask, **wish.move, **wish.method)

    verb = take_home.verb_of(source, mask is not None)
    started = Run(work, EXPECTED_STAGES[verb])
    started.finish = lambda done: Result(  # made in the run's thread, so that `run` finds it whole
        done, source, wish, marks if mask is not None else None, mask, about, tuple(started.warnings)
    )
    visit.run, visit.result = started, None
    started.start()
    return started.progress()


def run(visit: Visit, fields: Fields) -> dict[str, Any]:
    """How far the completion is; at its end its result. Raises what it failed with."""
    if visit.run is None:
        return {"state": "none"}
    told = visit.run.progress()
    if visit.run.state == "failed":
        error, visit.run = visit.run.error, None
        raise error or RuntimeError("the run failed")
    if visit.run.state == "done":
        visit.result, visit.run = visit.run.result, None
    if visit.result is not None and told["state"] == "done":
        told["result"] = told_result(visit.result)
    return told


def cancel(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Stop the completion."""
    visit.stop(wait=0.5)
    return {"state": "cancelled"}


def told_result(result: Result) -> dict[str, Any]:
    """What came out, for the page."""
    done, names = result.done, {upload.path: upload.name for upload in result.source.files.values()}
    view = pictures.result_views(done, False)[0]
    sides = ("left", "right") if result.source.pair is not None else ("left",)
    return {
        "width": view.camera.width,
        "height": view.camera.height,
        "pair": result.source.pair is not None,
        "moved": not view.camera.same_view_as(result.source.rgbd.camera),
        "removed": result.mask is not None,
        "hole_share": done.meta["hole_share"],
        "nothing_visible": done.meta["nothing_visible"],
        "seconds": done.meta["seconds"],
        "warnings": [take_home.shown(text, names) for text in result.warnings],
        "legends": {
            **{side: pictures.legends(done, side == "right") for side in sides},
            "scene": pictures.scene_origins(done),
        },
        "start": pictures.standpoint(view),
        "palette": [list(color) for color in pictures.ORIGIN_PALETTE],
        "how": take_home.how(result),
    }


def picture(visit: Visit, fields: Fields) -> Blob:
    """A picture of the result; `kind`, and `right` of a pair."""
    done = visit.needed_result().done
    return Blob(
        pictures.png(pictures.result_picture(done, str(fields.get("kind")), fields.get("right") is True)), "image/png"
    )


def pixel(visit: Visit, fields: Fields) -> dict[str, Any]:
    """What a pixel of the result holds; `x`, `y`, and `right` of a pair."""
    view, _ = pictures.result_views(visit.needed_result().done, fields.get("right") is True)
    return pictures.pixel(view, *pixel_of(fields))


def scene(visit: Visit, fields: Fields) -> Blob:
    """The completed scene as GLB, for the page."""
    data, step = take_home.glb_for_page(visit.needed_result(), visit.folder)
    return Blob(data, "model/gltf-binary", headers={"X-Step": str(step)})


def package(visit: Visit, fields: Fields) -> Blob:
    """Everything as a zip."""
    return Blob(take_home.zipped(visit.needed_result(), visit.folder), "application/zip", "dlama.zip")


def file(visit: Visit, fields: Fields) -> Blob:
    """One file of the result; `name`, one of those the result lists."""
    name = str(fields.get("name"))
    data = take_home.single(visit.needed_result(), name, visit.folder)
    return Blob(data, "application/octet-stream", name.rpartition("/")[2])


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
    "complete": complete,
    "run": run,
    "cancel": cancel,
    "picture": picture,
    "pixel": pixel,
    "scene": scene,
    "zip": package,
    "file": file,
}
"""Last part of the address -> what it does."""
UNLOCKED = ("alive", "run", "cancel", "preview")
"""Actions that need not wait for another one of the same visit."""
