"""Points in colour in; one self-contained page that turns them with the mouse (WebGL, no library) out."""

from __future__ import annotations

import base64
import html
import json
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.figures.false_color import ORIGIN_PALETTE
from dlama.geometry.motion.poses import transform_points

PAGE = Path(__file__).parents[2] / "assets" / "figures" / "points.html"
MOST_POINTS = 20_000
"""Drawn of a cloud, drawn by lot: 11 bytes a point, so that a saved notebook stays small (0.3 MB)."""
FRAME = "width:100%;max-width:720px;height:420px"
"""Size of the frame in a notebook, as CSS."""


def point_viewer(
    title: str,
    cloud: Any,
    cam_from_world: NDArray[np.float64] | None = None,
    *,
    most: int = MOST_POINTS,
    size: str = FRAME,
) -> str:
    """HTML of a PointCloud, which shows itself by it.

    Drag turns them, the wheel moves nearer; buttons show picture, origin or confidence. `cam_from_world` (4 x 4) says from
    where they are seen first, by default from the world's origin along z. Of more than `most` a sample is drawn. `size`: of
    the frame, as CSS.
    """
    points = cloud.points
    if not len(points):
        return f"<div><code>{html.escape(title)}</code>: no points to show</div>"
    pose = np.eye(4) if cam_from_world is None else np.asarray(cam_from_world, np.float64)
    drawn = np.arange(len(points))
    if len(points) > most:
        drawn = np.sort(np.random.default_rng(0).choice(len(points), most, replace=False))
        title = f"{title}, {most} points of {len(points)} shown"
    seen = transform_points(pose, points[drawn])
    middle = np.median(seen, axis=0)
    distance = np.linalg.norm(seen - middle, axis=1)
    scale = max(float(np.quantile(distance, 0.98)), 1e-6)  # a few far ones must not shrink the rest to a dot
    near = distance <= scale
    steps = np.rint(((seen[near] - middle) / scale + 1) / 2 * 65535).astype("<u2")
    fields = {
        "steps": steps,
        "color": cloud.color[drawn][near],
        "origin": np.array(ORIGIN_PALETTE, np.uint8)[cloud.origin[drawn][near]],
        "confidence": np.rint(np.clip(cloud.confidence[drawn][near], 0, 1) * 255).astype(np.uint8),
    }
    packed = {name: base64.b64encode(np.ascontiguousarray(value).tobytes()).decode() for name, value in fields.items()}
    # a step back: the whole scene is seen
    distance_of_eye = 1.3 * float(np.clip(np.linalg.norm(middle) / scale, 0.2, 4))
    page = Template(PAGE.read_text("utf-8")).substitute(data=json.dumps(packed), distance=f"{distance_of_eye:.4f}")
    return (
        f"<div><code>{html.escape(title)}</code>"
        f'<iframe title="{html.escape(title, quote=True)}" sandbox="allow-scripts" '
        f'style="display:block;{size};border:0;margin-top:8px" '
        f'srcdoc="{html.escape(page, quote=True)}"></iframe></div>'
    )
