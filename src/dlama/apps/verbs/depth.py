"""`dlama depth`: a picture in; its depth, its own or estimated by a network, as files out."""

from __future__ import annotations

from tyro.conf import Positional

from dlama.apps.command import command
from dlama.apps.options import Estimating, Image, Lens, Metres, Output, Report


def depth(
    image: Positional[Image],
    /,
    output: Output,
    lens: Lens,
    estimating: Estimating,
    report: Report,
    far: Metres = None,
) -> None:
    """The depth of a single picture, the photo's own or estimated by a network: depth files, a preview, camera and points.

    Args:
        image: The colour picture: PNG, JPEG, WebP, TIFF or HEIC.
        output: Directory for the results, made if need be; files of the same names are replaced.
        far: Depth at or beyond this is far (sky).
    """
    with command("depth", report) as this:
        this.run("depth", output, {"image": image}, lens, estimating, far=far)
