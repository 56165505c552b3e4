"""A visit and a request in; the completion under way, and what the page shows and saves of its result, out: actions of `api`."""

from __future__ import annotations

import json
from typing import Any

import dlama
from dlama.completion.report import describe_remaining_shadow
from dlama.completion.verbs import target_camera, view_pair
from dlama.files.scenes.photo3d_page import LARGEST_GLB, describe_box, glb_within, photo3d_page
from dlama.web import pictures
from dlama.web.answers import Blob, Fields, PageError, hide_paths, use_page_words
from dlama.web.completions import take_home
from dlama.web.completions.runs import Run
from dlama.web.form import read_request
from dlama.web.inputs import names_of, pixel_of
from dlama.web.marks import pointing
from dlama.web.visits import Result, Visit

EXPECTED_STAGES = {"view": 5, "remove": 5, "stereo": 7, "photo3d": 30}
"""Stages of a completion."""


def complete(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Begin the completion; `run` returns its progress."""
    source, mask, marks = visit.require_source(), visit.mask, visit.marks
    request = read_request(fields)
    target_camera(source.rgbd, **request.move)  # refused at once, not when the work begins
    found = visit.found[1] if visit.found else None
    about: dict[str, Any] = {}
    if mask is not None and found is not None and marks.in_words and source.pair is None:
        about = {**pointing(marks), "mask_model": None, **found.about}

    def completed() -> dlama.Completion:
        if source.pair is not None:
            pair = dlama.stereo(*source.pair, mask=mask, **request.method)
            return view_pair(pair, request.move, request.method) if request.move else pair
        if mask is None:
            return dlama.view(source.rgbd, **request.move, **request.method)
        return dlama.remove(source.rgbd, mask, **request.move, **request.method)

    def work() -> Result:
        done = completed()
        return Result(done, source, request, marks if mask is not None else None, mask, about, tuple(started.warnings))

    verb = take_home.verb_of(source, mask is not None)
    started = Run(work, EXPECTED_STAGES[verb])
    return begin(visit, started)


def begin(visit: Visit, started: Run) -> dict[str, Any]:
    """Start a run, which is the visit's from now on; its progress. PageError where another one is under way."""
    if visit.run is not None and visit.run.active:
        raise PageError("a completion is under way; cancel it first")
    visit.run = started
    started.start()
    return started.progress()


def turn(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Begin to fill what is hidden from all sides; `run` returns its progress."""
    result = visit.require_result()
    if visit.run is not None and visit.run.turns and visit.run.active:
        return visit.run.progress()

    def work() -> Result:
        _ = result.photo  # made, and kept, as it is asked for
        return result

    return begin(visit, Run(work, EXPECTED_STAGES["photo3d"], turns=True))


def run(visit: Visit, fields: Fields) -> dict[str, Any]:
    """How far the completion is; at its end its result. Raises what it failed with."""
    if visit.run is None:
        return {"state": "none"}
    answer = visit.run.progress()
    if visit.run.state == "failed":
        error, visit.run = visit.run.error, None
        raise error or RuntimeError("the run failed")
    if visit.run.state == "done":
        visit.result, visit.run = visit.run.result, None
    if visit.result is not None and answer["state"] == "done":
        answer["result"] = describe_result(visit.result)
    return answer


def cancel(visit: Visit, fields: Fields) -> dict[str, Any]:
    """Stop the completion."""
    visit.stop()
    return {"state": "cancelled"}


def hints(result: Result) -> list[str]:
    """What the command's last line says of a shadow that stays, in the page's words."""
    stays, marks = describe_remaining_shadow(result.done.meta), result.marks
    if not stays or marks is None or (marks.points_at and marks.with_shadow):
        return []
    return [f"{stays}: “with its shadow” removes it, too" if marks.points_at else stays]


def describe_result(result: Result) -> dict[str, Any]:
    """What came out, for the page."""
    done, names = result.done, names_of(result.source.files)
    view = pictures.result_views(done, False)[0]
    pair = isinstance(done, dlama.StereoCompletion)
    sides = ("left", "right") if pair else ("left",)
    return {
        "width": view.camera.width,
        "height": view.camera.height,
        "pair": pair,
        "moved": not view.camera.same_view_as(result.source.rgbd.camera),
        "removed": result.mask is not None,
        "hole_share": done.meta["hole_share"],
        "seconds": done.meta["seconds"],
        "filler": done.meta["filler"],
        "warnings": [*(use_page_words(hide_paths(text, names)) for text in result.warnings), *hints(result)],
        "legends": {
            **{side: pictures.legends(done, side == "right") for side in sides},
            "scene": pictures.scene_origins(done),
        },
        "palette": [list(color) for color in pictures.ORIGIN_PALETTE],
        "how": take_home.how(result),
    }


def picture(visit: Visit, fields: Fields) -> Blob:
    """A picture of the result; `kind`, and `right` of a pair."""
    done = visit.require_result().done
    return pictures.png(pictures.result_picture(done, str(fields.get("kind")), fields.get("right") is True))


def pixel(visit: Visit, fields: Fields) -> dict[str, Any]:
    """What a pixel of the result holds; `x`, `y`, and `right` of a pair."""
    view, _ = pictures.result_views(visit.require_result().done, fields.get("right") is True)
    return pictures.pixel(view, *pixel_of(fields))


def scene(visit: Visit, fields: Fields) -> Blob:
    """The 3-D photo as GLB, for the page; its box in a header."""
    photo, parts = visit.require_result().photo
    about = {"X-Box": json.dumps(describe_box(photo.box, parts))}
    return Blob(glb_within(parts, LARGEST_GLB), "model/gltf-binary", headers=about)


def photo3d(visit: Visit, fields: Fields) -> Blob:
    """The 3-D photo as one HTML file."""
    photo, parts = visit.require_result().photo
    return Blob(photo3d_page(photo.box, parts).encode(), "text/html", "photo3d.html")


def package(visit: Visit, fields: Fields) -> Blob:
    """Everything as a zip."""
    return Blob(take_home.zip_result(visit.require_result(), visit.folder), "application/zip", "dlama.zip")


def file(visit: Visit, fields: Fields) -> Blob:
    """One file of the result; `name`, one of those the result lists."""
    name = str(fields.get("name"))
    data = take_home.single_file(visit.require_result(), name, visit.folder)
    return Blob(data, "application/octet-stream", name.rpartition("/")[2])
