"""A 3-D photo in; one HTML file that shows it out: it holds everything, loads nothing, and opens from disk."""

from __future__ import annotations

import base64
import json
import math
import re
from pathlib import Path
from typing import Any

from dlama.files.scenes.textured_mesh import pack_parts, shrink_picture, textured_glb
from dlama.geometry.layers.head_box import HeadBox
from dlama.geometry.layers.layered_mesh import MeshPart

ASSETS = Path(__file__).parents[2] / "assets" / "web"
MODULE_LINES = re.compile(r"^import .*\n|^export (?=class|function|async|const)", re.M)
QUALITIES, LEAST_QUALITIES, STEPS = (90, 85, 80, 70, 60), (45, 30), (1, 2, 4)
"""Of the texture's JPEG, and by how much pictures with alpha, which are PNGs, are shrunk; the first that makes the file small
enough is taken."""
LARGEST_GLB = 10_000_000
"""Bytes that viewers of augmented reality take."""


def glb_within(parts: list[MeshPart], most: int) -> bytes:
    """The GLB file of a 3-D photo, of the best quality with which it has no more than so many bytes (or of the least)."""
    packed = pack_parts(parts)
    for step in STEPS if any(part.soft for part in packed) else STEPS[-1:]:
        smaller = [shrink_picture(part, step) if part.soft else part for part in packed]
        for quality in QUALITIES if step < STEPS[-1] else QUALITIES + LEAST_QUALITIES:
            found = b"".join(textured_glb(smaller, quality))
            if len(found) <= most:
                return found
    return found


def photo3d_page(box: HeadBox, parts: list[MeshPart]) -> str:
    """The HTML of a 3-D photo."""
    scripts = "".join((ASSETS / name).read_text("utf-8") for name in ("scene.js", "photo3d.js"))
    page = (ASSETS / "photo3d.html").read_text("utf-8")
    room = (8_000_000 - len(page) - len(scripts) - 2000) * 3 // 4  # 8 MB are still sent around
    filled = {
        "about": json.dumps(describe_box(box, parts)),
        "glb": base64.b64encode(glb_within(parts, room)).decode("ascii"),
        "script": MODULE_LINES.sub("", scripts),
    }
    for name, text in filled.items():
        page = page.replace(f"{{{{ {name} }}}}", text)
    return page


def mean_color(parts: list[MeshPart]) -> str:
    """Of the first picture, as CSS has it: what shows where nothing is drawn."""
    levels = parts[0].picture[::8, ::8].mean((0, 1)).tolist() if parts else [0, 0, 0]
    return f"rgb({', '.join(str(round(level)) for level in levels)})"


def describe_box(box: HeadBox, parts: list[MeshPart]) -> dict[str, Any]:
    """Where the view begins (pose, metres to the pivot, vertical degrees, aspect), how far it may go, and the colour under it,
    for the page."""
    camera = box.camera
    start = {
        "world_from_cam": camera.world_from_cam.tolist(),
        "pivot": box.pivot,
        "fovy": math.degrees(2 * math.atan(camera.height / (2 * camera.fy))),
        "aspect": camera.width / camera.height,
    }
    return {"start": start, "box": {"angle": box.angle, "distance": box.distance}, "under": mean_color(parts)}
