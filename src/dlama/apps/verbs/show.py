"""`dlama show`: a scene, a cloud, results or a data set in; a 3-D page in the browser out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from dlama.apps.options import Report, option
from dlama.apps.terminal.output import report_result


def show(
    what: Positional[Annotated[Path, option("SCENE|CLOUD|DIR|DATASET", None)]],
    /,
    *,
    report: Report,
    host: Annotated[str, option("HOST", "127.0.0.1")] = "127.0.0.1",
    port: Annotated[int, option("PORT", "8080")] = 8080,
    max_points: Annotated[int, option("N", "5000000")] = 5_000_000,
    open_browser: Annotated[bool, option("", "the browser is opened")] = True,
) -> None:
    """Shows a completed scene, a point cloud or a data set in 3-D, in the browser. Ctrl-C ends it.

    Args:
        what: scene.npz or scene.ply of a result, any PLY, the folder of a result, or of a data set with posed frames.
        host: Address to listen on; 0.0.0.0 shows it to the network.
        port: Port to listen on; the next free one where it is taken.
        max_points: Of more points so many are drawn, by lot.
        open_browser: The address is printed and no browser is opened.
    """
    with report_result("show", report) as result:
        from dlama.apps.viewer.contents import contents_of
        from dlama.apps.viewer.server import serve

        address = serve(contents_of(what), host, port, max_points, open_browser)
        result.add(f"{what}: no longer shown", shown=str(what), address=address)
