"""`dlama show`: a scene, a cloud, results or a data set in; its points in 3-D, as one page for the browser, out."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional

from dlama.apps.options import Report, option
from dlama.apps.places import check_file_apart
from dlama.apps.terminal.output import report_result
from dlama.errors import FileError, InputError, format_count

if TYPE_CHECKING:
    from dlama.geometry.camera import Camera
    from dlama.geometry.cloud import PointCloud

MOST_FRAMES = 100
"""Of a data set, evenly spread."""
WINDOW = "width:100%;height:92vh"


def show(
    what: Positional[Annotated[Path, option("SCENE|CLOUD|DIR|DATASET", None)]],
    /,
    *,
    report: Report,
    output: Annotated[Path | None, option("FILE.html", "a temporary file", aliases=["-o"])] = None,
    max_points: Annotated[int, option("N", "300000")] = 300_000,
    open_browser: Annotated[bool, option("", "the browser is opened")] = True,
) -> None:
    """Shows a completed scene, a point cloud or a data set in 3-D: one page that turns, by picture, origin or confidence.

    Args:
        what: scene.npz or scene.ply of a result, any PLY, the folder of a result, or of a data set with posed frames.
        output: The page, which loads nothing else.
        max_points: Of more points so many are drawn, by lot.
        open_browser: The page is written and no browser is opened.
    """
    if output is not None:
        check_file_apart(output, {"what is shown": what})
    with report_result("show", report) as result:
        from dlama.arguments import check_count
        from dlama.geometry.figures.points import point_viewer

        check_count(max_points, "max_points")
        cloud, camera, note = points_in(what)
        pose = None if camera is None else camera.cam_from_world
        content = point_viewer(
            str(what), cloud.points, cloud.color, cloud.origin, cloud.confidence, pose, most=max_points, size=WINDOW
        )
        page = show_page(content, output, open_browser)
        line = f"{page}: {format_count(len(cloud), 'point')} of {what}{note}"
        result.add(line, shown=str(what), page=str(page), points=len(cloud))


def show_page(content: str, output: Path | None, open_browser: bool) -> Path:
    """Write HTML as a page, to a temporary file by default, and open it in the browser; its path."""
    from dlama.files.atomic_write import new_file
    from dlama.geometry.figures.show import temporary_page, whole_page

    if output is not None:
        with new_file(output) as draft:
            draft.write_text(whole_page(content), encoding="utf-8")
    page = temporary_page(content) if output is None else output
    if open_browser:
        webbrowser.open(page.absolute().as_uri())
    return page


def points_in(path: Path) -> tuple[PointCloud, Camera | None, str]:
    """The points of a scene.npz, a .ply, a folder of results or of a data set; the first camera; what is not shown, in words.

    Raises InputError, FileError.
    """
    from dlama.datasets.layouts import RECORDINGS
    from dlama.files.scenes.clouds import read_ply
    from dlama.files.scenes.scene_npz import HOW_WRITTEN, read_npz
    from dlama.geometry.fusion import scene_cloud

    if not path.exists():
        raise FileError(
            f"{path}: no such file or folder; a scene.npz, a .ply, a folder of results or a data set is expected"
        )
    results, suffix = path / "scene.npz", path.suffix.lower()
    if path.is_dir() and not results.is_file() and (path / "meta.json").is_file() and (path / "image.png").is_file():
        raise FileError(f"{path}: holds no scene.npz; {HOW_WRITTEN}")
    camera, note = None, ""
    if suffix == ".npz" or results.is_file():
        _, scene = read_npz(results if path.is_dir() else path)
        cloud, camera = scene_cloud(scene, objects=False), scene.frames[0].camera
    elif path.is_dir() or suffix in RECORDINGS:
        cloud, camera, note = points_of_frames(path)
    elif suffix == ".ply":
        cloud = read_ply(path)
    else:
        kind = f"a {path.suffix} file" if path.suffix else "a file without an ending"
        raise InputError(f"{path}: is {kind}; a scene.npz, a .ply or a folder is expected")
    if not len(cloud):
        raise InputError(f"{path}: holds no points, so that there is nothing to show")
    return cloud, camera, note


def points_of_frames(folder: Path) -> tuple[PointCloud, Camera, str]:
    """The same of the frames of a data set, at most MOST_FRAMES, as measured."""
    import numpy as np

    from dlama.datasets.layouts import open_dataset
    from dlama.geometry.cloud import concatenate
    from dlama.geometry.projection import lift

    listed = open_dataset(folder).frames
    if not listed:
        raise InputError(f"{folder}: lists no posed frames with depth, so that there is nothing to show in 3-D")
    first = [each for each in listed if each.scene == listed[0].scene]
    picked = [first[round(at)] for at in np.linspace(0, len(first) - 1, min(len(first), MOST_FRAMES))]
    left_out = f"; {len(picked)} of {len(listed)} frames, all of scene {listed[0].scene!r}"
    frames = [each.load() for each in picked]
    note = left_out if len(picked) < len(listed) else ""
    return concatenate([lift(each) for each in frames]), frames[0].camera, note
