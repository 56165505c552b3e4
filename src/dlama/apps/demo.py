"""The street scene that comes with dlama in; all three jobs done on it, and one joint preview, out."""

from __future__ import annotations

from pathlib import Path

from dlama.apps.jobs import Job
from dlama.apps.options import Lens, Masking, Method, Reading
from dlama.completion import stereo as pairs
from dlama.completion import verbs
from dlama.completion.pipeline import Completion

ASSETS = Path(__file__).parent.parent / "assets" / "demo"
"""Picture, depth, mask, camera and stereo pair; its README names their sources."""
YAW = 20.0
"""Degrees by which the demo's camera moves to the right."""


def demo_view(run: Job, method: Method) -> Completion:
    """The street from 20 degrees further right."""
    rgbd = run.rgbd(ASSETS / "street.jpg", ASSETS / "depth.png", Lens(camera=ASSETS / "camera.json"), Reading())
    return verbs.view(rgbd, yaw=YAW, **method.settings())


def demo_remove(run: Job, method: Method) -> Completion:
    """The street without the barrel and its shadow."""
    rgbd = run.rgbd(ASSETS / "street.jpg", ASSETS / "depth.png", Lens(camera=ASSETS / "camera.json"), Reading())
    return verbs.remove(rgbd, run.required_mask(ASSETS / "mask.png", Masking()), **method.settings())


def demo_stereo(run: Job, method: Method) -> Completion:
    """Depth from the stereo pair, and both pictures without the barrel."""
    pair = run.pair(ASSETS / "street.jpg", ASSETS / "right.jpg", ASSETS / "calib.txt")
    return pairs.stereo(*pair, mask=run.mask(ASSETS / "mask.png", Masking()), **method.settings())


JOBS = {
    "view": ("from 20° further right", demo_view),
    "remove": ("without the barrel", demo_remove),
    "stereo": ("stereo, without the barrel", demo_stereo),
}
"""Sub-directory -> what the joint sheet calls the job, and the job."""


def demo(output: Path, method: Method) -> list[str]:
    """Each job's results to a sub-directory of `output`, and preview.png of all; returns a summary line for each.

    Raises OutputError; then nothing is left behind.
    """
    from dlama.files.atomic_write import new_directory
    from dlama.files.preview import write_preview
    from dlama.files.sheets import demo_legend, demo_panels

    lines, panels, completions = [], [], []
    with new_directory(output) as folder:
        for name, (called, do) in JOBS.items():
            run = Job()
            done = do(run, method)
            run.write(done, folder / name, shown=output / name)
            lines.append(run.summary)
            panels += demo_panels(called, done)
            completions.append(done)
        write_preview(
            folder / "preview.png", "dlama completes what a camera could not see", panels, demo_legend(completions)
        )
    return [*lines, f"{output / 'preview.png'}: all three side by side"]
