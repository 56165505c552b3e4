"""A completion in; its preview out, a contact sheet of what was known, what was missing and why, and what was filled."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from dlama.completion.completion import Completion, StereoCompletion
from dlama.files.results.contact_sheet import PANEL_WIDTH, Panel, write_contact_sheet
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.figures.false_color import HOLE_PALETTE, RGB, depth_limits, depth_picture, hole_picture
from dlama.geometry.holes import erode_square
from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.view import View
from dlama.writing.atomic_write import PathLike


def hole_legend(*pictures: UInt8Array) -> list[tuple[str, RGB]]:
    """(name with its share, the mean of the pictures of hole types as in `title`, colour) of those that occur, for a legend."""
    shares = {code: float(np.mean([(types == code).mean() for types in pictures])) for code in HoleType if code}
    return [(f"{name_code(code)} {percent(share)}", HOLE_PALETTE[code]) for code, share in shares.items() if share]


def name_code(code: HoleType | Origin) -> str:
    """What people call it: out of view."""
    return code.name.lower().replace("_", " ")


def percent(share: float) -> str:
    """0.1234 -> "12.3 %"; what is there but tiny is not called 0."""
    return f"{100 * share:.1f} %" if share >= 0.0005 or share == 0 else "<0.1 %"


def write_preview(path: PathLike, completion: Completion) -> None:
    """Write the preview of one completion as a picture, colour and depth. Raises OutputError."""
    legend = hole_legend(*(before.hole_type for before in completion.warped))
    write_contact_sheet(path, title(completion), panels(completion), legend)


def title(completion: Completion) -> str:
    """What was done, in a line."""
    meta = completion.meta
    unknown, depth_only = (float(np.mean(meta[name])) for name in ("hole_share", "depth_only_share"))
    lacking = f"{percent(unknown)} was unknown" + (f", {percent(depth_only)} lacked only depth" if depth_only else "")
    return f"{job_name(completion)}: {lacking}, filled by '{meta['filler']}'"


def job_name(completion: Completion) -> str:
    """What was done, as the completion shows."""
    removed = bool(completion.scene.removals)
    if isinstance(completion, StereoCompletion):
        return "Object removed from both pictures" if removed else "Depth from a stereo pair"
    several = f" ({len(completion.views)} views)" if len(completion.views) > 1 else ""
    if all(view.camera.same_view_as(completion.source.camera) for view in completion.views):
        return "Object removed" if removed else "Sensor holes filled"
    return ("Object removed, seen from elsewhere" if removed else "Seen from elsewhere") + several


def panels(completion: Completion) -> list[Panel]:
    """The panels of a sheet, row by row."""
    if isinstance(completion, StereoCompletion):
        limits = shared_depth_limits(completion)
        return [
            panel
            for side, before, view in zip(("left: ", "right: "), completion.warped, completion.views)
            for panel in (*color_panels(side, before, view), completed_depth(side, view, limits))
        ]
    if len(completion.views) > 1:
        pairs = list(zip(completion.warped, completion.views))[:5]  # the others have pictures of their own
        several = [color_panels(f"view {number}: ", *pair) for number, pair in enumerate(pairs, 1)]
        return [source_panel(completion), *(panel for both in several for panel in both)]
    before, view = completion.warped[0], completion.views[0]
    source, limits = completion.source, shared_depth_limits(completion)
    name = "depth of the source" + (", estimated" if completion.meta.get("depth") == "estimated" else "")
    return [
        source_panel(completion),
        *color_panels("", before, view),
        (name, depth_picture(subsample(source.depth), subsample(source.hole), *limits)),
        ("depth known", depth_picture(subsample(before.depth), subsample(before.hole), *limits)),
        completed_depth("", view, limits),
    ]


def demo_panels(name: str, completion: Completion) -> list[Panel]:
    """Four panels of one job for the joint sheet: source, what is missing, colour and depth completed."""
    before, view = completion.warped[-1], completion.views[-1]
    return [
        (f"{name}: source picture", source_panel(completion)[1]),
        *color_panels("right view: " if isinstance(completion, StereoCompletion) else "", before, view),
        completed_depth("", view, shared_depth_limits(completion)),
    ]


def demo_legend(completions: Sequence[Completion]) -> list[tuple[str, RGB]]:
    """Names and colours of the hole types that occur in any of the jobs."""
    found = {int(code) for done in completions for view in done.warped for code in np.unique(view.hole_type)}
    return [(name_code(code), HOLE_PALETTE[code]) for code in HoleType if code and code in found]


def source_panel(completion: Completion) -> Panel:
    """The source picture; what is to be removed is tinted and outlined."""
    if not completion.scene.removals:
        return "source", average_down(completion.source.color)
    removed = subsample(completion.scene.layers[0].load().hole_type) == HoleType.OBJECT.value
    return "source, marked: to be removed", tint(average_down(completion.source.color), removed)


def tint(color: UInt8Array, where: np.ndarray) -> UInt8Array:
    """uint8 H x W x 3: half red where `where` (H x W bool) is True, red at its rim."""
    out, red = color.copy(), np.array((255, 60, 60), np.uint8)
    out[where] = color[where] // 2 + red // 2
    out[where & ~erode_square(where, 5)] = red
    return out


def color_panels(start: str, before: View, view: View) -> tuple[Panel, Panel]:
    """What is known and why the rest is not; completed. start: of the captions."""
    known = hole_picture(average_down(before.color), subsample(before.hole_type))
    return (f"{start}known, holes by type", known), (f"{start}completed", average_down(view.color))


def completed_depth(start: str, view: View, limits: tuple[float, float]) -> Panel:
    """Depth completed; limits: nearest and farthest depth (m) of the colours, which are the same all over the sheet. start: of
    the caption."""
    picture = depth_picture(subsample(view.depth), subsample(view.hole), *limits)
    return f"{start}depth completed, {limits[0]:.2g} to {limits[1]:.2g} m", picture


def shared_depth_limits(completion: Completion) -> tuple[float, float]:
    """The nearest and the farthest depth of all panels' colours."""
    return depth_limits(subsample(completion.source.depth), *(subsample(view.depth) for view in completion.views))


def preview_step(picture: np.ndarray) -> int:
    """How many pixels of a picture become one before it is drawn: panels show it smaller still."""
    return max(1, min(picture.shape[:2]) // (2 * PANEL_WIDTH))


def subsample(values: np.ndarray) -> np.ndarray:
    """The middle one of each `preview_step` squared values of H x W depths or codes."""
    step = preview_step(values)
    rows, columns = (side // step * step for side in values.shape)
    return values[step // 2 : rows : step, step // 2 : columns : step]


def average_down(color: UInt8Array) -> UInt8Array:
    """Colours (H x W x 3) of the pixels that `subsample` gives, each the mean of those that it stands for."""
    step = preview_step(color)
    if step == 1:
        return color
    rows, columns = (side // step for side in color.shape[:2])
    whole = np.ascontiguousarray(color[: rows * step, : columns * step])
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA), np.uint8)
