"""A batch and the network's output in -> one PNG: a row per sample; input, output, truth; colours, then depth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from torch import Tensor

from dlama.files.atomic_write import new_file
from dlama.training.data.batches import Batch, composited, hole_planes
from dlama.training.settings import NetworkSettings

ROWS = 6
GAP, TOP = 4, 18
HOLE = np.array([255, 0, 255], np.uint8)
"""Magenta: what the network does not see."""


def write_sheet(path: Path, output: Tensor, batch: Batch, network: NetworkSettings) -> None:
    """The first six samples. The output is composited: known pixels are the truth's. OutputError."""
    import cv2

    sheet = sheet_of(output, batch, network)
    path.parent.mkdir(parents=True, exist_ok=True)
    with new_file(path) as draft:
        draft.write_bytes(cv2.imencode(".png", np.ascontiguousarray(sheet[..., ::-1]))[1].tobytes())


def sheet_of(output: Tensor, batch: Batch, network: NetworkSettings) -> np.ndarray:
    """The same as uint8 H x W x 3 RGB."""
    import cv2

    planes = output.shape[1]
    filled = composited(output.float(), batch).cpu().numpy()
    truth, hole = batch["target"].cpu().numpy(), hole_planes(batch["mask"], planes).cpu().numpy() > 0
    firsts = [3 * view for view in range(network.views)] + ([planes - 1] if network.has_depth else [])
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
    return sheet


def _panels(truth: np.ndarray, filled: np.ndarray, hole: np.ndarray, first: int, planes: int) -> list[np.ndarray]:
    """Three pictures of colour planes, or of the depth plane."""
    shown = []
    for picture in (truth, filled, truth):
        part = picture[first:] if first == planes - 1 else picture[first : first + 3]
        levels = np.round(np.clip(part, 0, 1) * 255).astype(np.uint8).transpose(1, 2, 0)
        shown.append(np.array(_colored(levels) if levels.shape[2] == 1 else levels))
    shown[0][hole] = HOLE
    return [np.pad(panel, ((0, GAP), (0, GAP), (0, 0))) for panel in shown]


def _colored(levels: np.ndarray) -> np.ndarray:
    """Near is red, far is blue."""
    import cv2

    return np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_TURBO))[..., ::-1]
