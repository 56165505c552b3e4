"""`dlama depth`: a picture in; its depth, its own or estimated by a network, as files out."""

from __future__ import annotations

import time

from tyro.conf import Positional

from dlama.apps.command import command
from dlama.apps.options import Estimating, Image, Lens, Metres, Output, Reading, Report, Results
from dlama.apps.terminal.flags import flags_of, with_flags


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
    from dlama.files.results.estimated_depth import FILES, write_depth
    from dlama.geometry.rgbd import describe_depth_range
    from dlama.perception.depth_scale import RULES, describe_depth_source

    with command("depth", report) as this:
        this.check(output, Results(), {"image": image}, image, {"far": far}, estimating.settings())
        rgbd = this.rgbd(image, None, lens, Reading(far=far), estimating)
        write_depth(rgbd, output, inputs=this.inputs, seconds={"read": round(this.read_seconds, 4)})
        about = dict(rgbd.estimate or {})
        scale = with_flags(RULES[about["scale"]["rule"]], flags_of(depth))
        line = f"{output}: {describe_depth_range(rgbd.depth)}, {describe_depth_source(about)}, {scale}"
        values = {"output": str(output), "files": list(FILES), "depth_estimate": about}
        this.result.add(f"{line}, {time.perf_counter() - this.started:.1f} s", **values)
