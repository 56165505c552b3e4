"""A finished run in -> what somebody who gets the network must know, as Markdown, out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dlama import __version__
from dlama.training.flops import budget
from dlama.training.settings import TrainSettings


@dataclass(frozen=True)
class Story:
    """How the training went."""

    step: int
    samples: int
    seconds: float
    ended: str
    """Why it stopped."""
    trunk: str
    """Which perceptual trunk ran, and what follows from it."""
    data: str
    """What the samples came from."""
    device: str
    restored: int
    """How often the run went back because a number was none any more."""


def model_card(
    settings: TrainSettings, story: Story, scores: Mapping[str, float], reference: Mapping[str, float]
) -> str:
    """README.md of a run directory.

    Args:
        scores: of the moving average on the held-out samples, see `validation.hole_metrics`.
        reference: the same of OpenCV's Telea.
    """
    file = f"{settings.name}.onnx"
    rows = [f"| {name} | {value:.4f} | {reference[name]:.4f} |" for name, value in scores.items()]
    lines = [
        f"# {settings.name}",
        "",
        f"Fills {_WHAT[settings.network.planes]}. {budget(settings, 512)}.",
        "",
        "| file | what |",
        "|---|---|",
        f"| {file} | the network with its contract, for `--model {file}` |",
        f"| {settings.name}.safetensors | the same weights under LaMa's published names |",
        "",
        f"Licence of the weights: {settings.licence}.",
        "",
        "## Training",
        "",
        f"* {story.step} steps, {story.samples} samples of {settings.data.size} x {settings.data.size} pixels, "
        f"{story.seconds / 60:.1f} minutes on {story.device}; ended: {story.ended}.",
        f"* Samples: {story.data}; mixture {dict(settings.data.mixture)}.",
        f"* {story.trunk[0].upper()}{story.trunk[1:]}.",
        f"* Started from {settings.network.start or 'random weights'}; exported is the moving average of the weights.",
        f"* Went back to an earlier state {story.restored} times because a gradient was no number.",
        f"* dlama {__version__}; all settings are in settings.json, the learning curve is in metrics.csv.",
        "",
        f"## On {settings.data.held_out} held-out samples",
        "",
        "Measured in the hole, composited; colour 0..1, depth as inverse depth on the scale of the nearest known pixel.",
        "",
        f"| | {settings.name} | Telea |",
        "|---|---|---|",
        *rows,
        "",
    ]
    return "\n".join(lines)


_WHAT = {
    "rgb": "colour (4 planes in, 3 out)",
    "rgbd": "colour and depth together (5 planes in: red, green, blue, depth, mask; 4 out)",
    "stereo": "both pictures of a stereo pair together (7 planes in: left, right, the union of both masks; 6 out)",
    "stereo-two-masks": "both pictures of a stereo pair together (8 planes in: left, right, left mask, right mask; 6 out)",
}
