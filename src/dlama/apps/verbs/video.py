"""`dlama video`: a scene, or a data set of posed frames, and a path in; a video of it out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional

import dlama
from dlama.apps.options import Filler, Report, given_options, option
from dlama.apps.places import check_file_apart
from dlama.apps.terminal.output import counting_bar, report_result
from dlama.apps.verbs.sequence import Source
from dlama.errors import format_count
from dlama.inpainters import AUTO

if TYPE_CHECKING:
    from dlama.geometry.rgbd import UInt8Array


@dataclass(frozen=True)
class Moving:
    """How the camera moves, and the size of the video."""

    path: Annotated[str, option("orbit|spiral|dolly|CAMERAS.json", "spiral")] = "spiral"
    """How the camera moves from the middle frame; or a file with a list of cameras, between which it moves evenly."""
    seconds: Annotated[float, option("S", "6")] = 6.0
    """How long it is."""
    fps: Annotated[float, option("N", "24")] = 24.0
    """Pictures a second."""
    width: Annotated[int | None, option("PX", "the frames'")] = None
    """Of the video; its height follows."""


def video(
    source: Positional[Annotated[Path, option("SCENE.npz|DATASET", None)]],
    /,
    *,
    output: Annotated[Path, option("OUT.mp4", None, aliases=["-o"])],
    frames: Source,
    filler: Filler,
    moving: Moving,
    report: Report,
) -> None:
    """A video of a camera that moves through a scene; what no picture shows is filled once, so that nothing flickers.

    Args:
        source: A scene.npz that dlama wrote (of a picture `dlama photo3d IMAGE DEPTH --only scene` does), or the folder of a data
            set of posed frames.
        output: The video: .mp4 (extra `video`), or .webp or .gif, which need nothing more. `dlama sequence SCENE --views` writes
            pictures, with their depth.
    """
    from dlama.completion.start import choose_filler
    from dlama.datasets.sequences.camera_paths import path_for
    from dlama.datasets.sequences.loading import read_scene_of
    from dlama.files.results.video import check_video, write_video

    with report_result("video", report) as result, counting_bar("video", report) as bar:
        check_video(output, moving.fps)
        check_file_apart(output, {"what is shown": source})
        scene = read_scene_of(source, **vars(frames)).scene
        cameras = path_for(moving.path, scene, moving.seconds, moving.fps, moving.width)
        check_video(output, moving.fps, cameras[0].hw)
        how = given_options(filler)
        chosen = choose_filler(scene.has_estimated_depth, how.pop("filler", AUTO), how.get("model")).name
        views = dlama.render_path(scene, cameras, filler=chosen, **how)

        def pictures() -> Iterator[UInt8Array]:
            for number, view in enumerate(views, 1):
                bar(number, len(cameras))
                yield view.color

        fps = moving.fps
        count = write_video(output, pictures(), fps)
        line = f"{output}: {format_count(count, 'picture')}, {count / fps:.1f} s at {fps:g} a second, filler {chosen}"
        result.add(f"{line}, {result.seconds:.1f} s", output=str(output), pictures=count, filler=chosen)
