"""`dlama show`: a scene, a cloud, results or a data set in; its points in 3-D, as one page for the browser, out."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from dlama.apps.options import Report, option
from dlama.apps.places import check_file_apart
from dlama.apps.terminal.output import report_result
from dlama.errors import format_count
from dlama.geometry.figures.show import temporary_page, whole_page
from dlama.writing.atomic_write import write_file

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
        what: scene.npz or scene.ply of a result, any PLY with colours, the folder of a result, or of a data set with posed
            frames.
        output: The page, which loads nothing else.
        max_points: Of more points so many are drawn, by lot.
        open_browser: The page is written and no browser is opened.
    """
    if output is not None:
        check_file_apart(output, {"what is shown": what})
    with report_result("show", report) as result:
        from dlama.arguments import check_count
        from dlama.datasets.points import points_in
        from dlama.geometry.figures.points import point_viewer

        check_count(max_points, "max_points")
        cloud, camera, note = points_in(what)
        pose = None if camera is None else camera.cam_from_world
        content = point_viewer(str(what), cloud, pose, most=max_points, size=WINDOW)
        page = show_page(content, output, open_browser)
        line = f"{page}: {format_count(len(cloud), 'point')} of {what}{note}"
        result.add(line, shown=str(what), page=str(page), points=len(cloud))


def show_page(content: str, output: Path | None, open_browser: bool) -> Path:
    """Write HTML as a page, to a temporary file by default, and open it in the browser; its path."""
    if output is not None:
        write_file(output, whole_page(content))
    page = temporary_page(content) if output is None else output
    if open_browser:
        webbrowser.open(page.absolute().as_uri())
    return page
