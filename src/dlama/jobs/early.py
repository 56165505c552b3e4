"""The options of one job in; InputError, which names all that are wrong, before a picture is read or anything computed, out.

What finds a pointed object is imported where one is pointed at: most jobs need none of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from dlama.completion.options import options_of, raise_all
from dlama.errors import FileError, InputError
from dlama.files.rasters.depth import check_depth_options
from dlama.files.rasters.images import picture_hw
from dlama.files.results.completion import check_results
from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import dolly, orbit
from dlama.inpainters import AUTO, model_file
from dlama.jobs.parameters import METHOD, MOVE, POINTING, mask_settings
from dlama.perception.depth_scale import check_known
from dlama.perception.masks.prompt import Prompt


def check_options(
    given: Mapping[str, Any], image: Path | None = None, removes: bool = True, pair: bool = False
) -> None:
    """Raise InputError for options of view, remove, stereo or depth that cannot be, all of them in one message.

    given: by name, as `jobs.parameters` reads them. image: the picture that is pointed at.
    removes: whether the job removes an object, whose mask can be written; pair: whether it completes both pictures of a pair,
    which have a disparity.
    """

    def one(name: str, default: Any = None) -> Any:
        return given[name] if given.get(name) is not None else default

    options = {name: given[name] for name in METHOD if given.get(name) is not None}
    checks: list[Callable[[], Any]] = [
        lambda: options_of(options),
        lambda: _check_results(check_results(given.get("only"), given.get("also") or ()), removes, pair),
        lambda: one("filler", AUTO) == AUTO or callable(given["filler"]) or model_file(given["filler"], one("model")),
        lambda: check_depth_options(one("depth_scale"), one("depth_range"), one("far")),
        lambda: one("fov") is None or Camera.from_fov(1000, 1000, given["fov"]),
        *(partial(_check_move, {name: one(name)}) for name in MOVE if one(name) is not None and name != "to"),
        lambda: _check_pointing(given, image),
        lambda: _check_scale(given, image),
    ]
    raise_all(checks)


def _check_results(names: tuple[str, ...], removes: bool, pair: bool) -> None:
    """A result by name that the job does not have."""
    if "mask" in names and not removes:
        raise InputError("`mask` is to be written, and no object is removed whose mask it would be")
    if "disparity" in names and not pair:
        raise InputError("disparity is to be written, which only the pictures of a stereo pair have")


def _check_move(given: Mapping[str, Any]) -> None:
    """An orbit and a dolly that no camera can make."""
    pivot = given.get("pivot", "auto")
    yaw, pitch, ahead = (given.get(name, 0.0) for name in ("yaw", "pitch", "dolly"))
    dolly(orbit(Camera.from_fov(2, 2, 60), yaw, pitch, pivot), ahead)


def _check_pointing(given: Mapping[str, Any], image: Path | None) -> None:
    """What points at an object, held against the size of the picture."""
    pointing = {name: given[name] for name in POINTING if name in given and name != "object_class"}
    if not pointing:
        return
    from dlama.perception.object_masks import check_names

    find = mask_settings(pointing)
    check_names(find["masker"], find["mask_model"], find["candidate"])
    hw = _size(image)
    if hw is not None and (find["clicks"] or find["not_clicks"] or find["box"]):
        on, not_on = (tuple(map(tuple, find[name])) for name in ("clicks", "not_clicks"))
        Prompt(hw, on, not_on, find["box"])


def _check_scale(given: Mapping[str, Any], image: Path | None) -> None:
    """What is known of the scale of estimated depth."""
    known, height = given.get("metres_at") or (), given.get("camera_height")
    if known or height is not None:
        check_known(known, height, _size(image))


def _size(image: Path | None) -> tuple[int, int] | None:
    """(height, width) of the picture; None where there is none that can be read, which its reader says."""
    try:
        return None if image is None else picture_hw(image)
    except FileError:
        return None
