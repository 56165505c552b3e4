"""Outputs on the held-out samples in -> metrics of the hole, and sheets of pictures (PNG), out.

Metrics are means over the hole of each sample, then over the samples. Colour is 0..1; depth is normalised inverse depth (see
`batches`).
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor, nn

from dlama.files.rasters.pictures import write_color
from dlama.inpainters.networks.view_tensors import color_from_planes, color_planes, levels_of
from dlama.inpainters.opencv import paint
from dlama.training.data.batches import Batch, composite, hole_planes
from dlama.training.losses.pixels import TOLERANCE
from dlama.training.settings import NetworkSettings, TrainSettings

ROWS = 6
"""Samples of a sheet."""
GAP, TOP = 4, 18
"""Pixels between panels, and above them for their names."""
HOLE = np.array([255, 0, 255], np.uint8)
"""Magenta: the hole of inputs on a sheet."""


def metric_names(network: NetworkSettings) -> list[str]:
    """The keys of `hole_metrics` for such a network."""
    return ["color_l1", "color_psnr", *(["depth_l1", "law_broken"] if network.kind.has_depth else [])]


@torch.no_grad()
def outputs_of(network: nn.Module, batch: Batch, settings: TrainSettings, device: torch.device) -> Tensor:
    """The network's outputs (B x P x H x W, float32) on the CPU, computed in batches as large as the run's."""
    parts = [network(part.to(device)).float().cpu() for part in batch["input"].split(settings.loop.batch)]
    return torch.cat(parts)


def scores_of(network: nn.Module, batch: Batch, settings: TrainSettings, device: torch.device) -> dict[str, float]:
    """`hole_metrics` of the outputs of a network that is in eval mode."""
    return hole_metrics(outputs_of(network, batch, settings, device), batch, settings.network)


@torch.no_grad()
def hole_metrics(output: Tensor, batch: Batch, network: NetworkSettings) -> dict[str, float]:
    """Metrics of an output (B x P x H x W, 0..1) in the hole, by name.

    color_l1; color_psnr (dB, of the hole's mean squared error); for networks with depth depth_l1 where the truth is known, and
    law_broken: share of the hole that is nearer than the visibility law allows.
    """
    filled, colors = composite(output.float(), batch), 3 * network.kind.views
    mine, true, hole = filled[:, :colors], batch["target"][:, :colors], hole_planes(batch["mask"], colors)
    squared = _weighted_mean(hole, (mine - true).square())
    found = {
        "color_l1": _weighted_mean(hole, (mine - true).abs()),
        "color_psnr": -10 * squared.clamp(min=1e-10).log10(),
    }
    if network.kind.has_depth:
        depth, truth = filled[:, -1:], batch["target"][:, -1:]
        found["depth_l1"] = _weighted_mean(batch["mask"] * batch["known_depth"], (depth - truth).abs())
        nearer = (depth > batch["limit"] * (1 + TOLERANCE)).float()
        found["law_broken"] = _weighted_mean(batch["mask"], nearer)
    return {name: float(values.mean()) for name, values in found.items()}


def telea(batch: Batch) -> Tensor:
    """The target with its hole filled by OpenCV's Telea (colour in 8 bit, depth in 16), B x P x H x W: a reference."""
    planes = batch["target"].shape[1]
    holes = hole_planes(batch["mask"], planes).cpu().numpy() > 0
    filled = batch["target"].cpu().numpy() * ~holes
    for sample, hole in zip(filled, holes):
        for first in range(0, planes - 2, 3):
            part = slice(first, first + 3)
            sample[part] = color_planes(paint(color_from_planes(sample[part]), hole[first]))
        if planes % 3:
            sample[-1] = paint(np.round(sample[-1] * 65535).astype(np.uint16), hole[-1]) / np.float32(65535)
    return torch.from_numpy(filled).to(batch["target"].device)


def _weighted_mean(weight: Tensor, values: Tensor) -> Tensor:
    """B x P x H x W -> B means over the weighted pixels."""
    return (values * weight).flatten(1).sum(1) / weight.flatten(1).sum(1).clamp(min=1)


def write_sheet(path: Path, output: Tensor, batch: Batch, network: NetworkSettings) -> None:
    """Write a PNG with a row for each of the first ROWS samples: input, output, truth; of colours, then of depth.

    The output is composited: known pixels are those of the truth. OutputError.
    """
    planes = output.shape[1]
    filled = composite(output.float(), batch).cpu().numpy()
    truth, hole = batch["target"].cpu().numpy(), hole_planes(batch["mask"], planes).cpu().numpy() > 0
    firsts = [3 * view for view in range(network.kind.views)] + ([planes - 1] if network.kind.has_depth else [])
    rows = []
    for i in range(min(ROWS, len(truth))):
        panels = []
        for first in firsts:
            panels += _panels(truth[i], filled[i], hole[i, first], first, planes)
        rows.append(np.concatenate(panels, 1))
    sheet = np.concatenate([np.zeros((TOP, rows[0].shape[1], 3), np.uint8), *rows])
    for column, word in enumerate(len(firsts) * ("input", "output", "truth")):
        at = (column * (truth.shape[3] + GAP) + 2, TOP - 5)
        cv2.putText(sheet, word, at, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1, cv2.LINE_AA)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_color(path, sheet)


def _panels(truth: np.ndarray, filled: np.ndarray, hole: np.ndarray, first: int, planes: int) -> list[np.ndarray]:
    """Input, output and truth of three colour planes from `first` on, or of the depth plane; each H x W x 3."""
    shown = []
    for picture in (truth, filled, truth):
        part = picture[first:] if first == planes - 1 else picture[first : first + 3]
        levels: np.ndarray = levels_of(part).transpose(1, 2, 0)
        if levels.shape[2] == 1:  # near is red, far is blue
            levels = np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_TURBO))[..., ::-1]
        shown.append(np.array(levels))
    shown[0][hole] = HOLE
    return [np.pad(panel, ((0, GAP), (0, GAP), (0, 0))) for panel in shown]
