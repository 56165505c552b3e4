"""Slow literal twin of the surface mode: every target pixel's ray against every triangle, in float64, in three dimensions.

Where a ray passes so near to a silhouette that rounding decides, the pixel is reported as unsure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlama.geometry.camera import Camera
from worlds import pixels_of, points_of

MARGIN = 1e-3
"""Share of a triangle's height, and pixels of a footprint, within which a hit is unsure."""


@dataclass
class Drawing:
    """What the twin drew: H x W of the target."""

    depth: np.ndarray
    """Planar z, 0 = nothing."""
    where: np.ndarray
    """... x 2, source column and row shown (0 = the first pixel's centre)."""
    unsure: np.ndarray
    """bool."""


def sides_of(right: np.ndarray, down: np.ndarray, row: int, column: int) -> tuple[bool, bool, bool, bool]:
    """Which sides (top, left, right, bottom) of the quad whose upper left pixel is (row, column) are joined."""
    return right[row, column], down[row, column], down[row, column + 1], right[row + 1, column]


def triangles_of(right: np.ndarray, down: np.ndarray, w: np.ndarray) -> list[tuple[tuple[int, int], ...]]:
    """All triangles as three (row, column), clockwise on the screen.

    A quad joined all round is cut along the diagonal whose ends differ less in the target's inverse depth w; one with two
    joined sides at a corner keeps that corner's triangle; else there is none.
    """
    found = []
    for r in range(w.shape[0] - 1):
        for c in range(w.shape[1] - 1):
            top, left, side, bottom = sides_of(right, down, r, c)
            a, b, lower, d = (r, c), (r, c + 1), (r + 1, c), (r + 1, c + 1)
            if top and left and side and bottom:
                along_bc = abs(w[b] - w[lower]) <= abs(w[a] - w[d])
                found += [(a, b, lower), (b, d, lower)] if along_bc else [(a, b, d), (a, d, lower)]
                continue
            corners = [(top, left, (a, b, lower)), (side, bottom, (b, d, lower))]
            corners += [(top, side, (a, b, d)), (left, bottom, (a, d, lower))]
            found += [corner for one, other, corner in corners if one and other]
    return found


def is_rim(right: np.ndarray, down: np.ndarray, row: int, column: int) -> bool:
    """True unless four wholly joined quads meet at the pixel."""
    height, width = right.shape[0], down.shape[1]
    if row in (0, height - 1) or column in (0, width - 1):
        return True
    quads = [(row - 1, column - 1), (row - 1, column), (row, column - 1), (row, column)]
    return not all(all(sides_of(right, down, *quad)) for quad in quads)


def draw(
    depth: np.ndarray, right: np.ndarray, down: np.ndarray, source: Camera, target: Camera, near: float
) -> Drawing:
    """The joined grid seen from the target camera. depth: source z, 0 = no vertex, far pixels are none."""
    there = (depth > 0) & (depth < np.inf)
    world = points_of(source, np.where(there, depth, 1.0).astype(np.float64))
    points = (world - target.world_from_cam[:3, 3]) @ target.world_from_cam[:3, :3]
    shown = there & (points[..., 2] > near)
    w = np.where(shown, 1 / np.where(shown, points[..., 2], 1.0), 0.0)
    triangles = [t for t in triangles_of(right, down, w) if all(shown[vertex] for vertex in t)]
    strict, loose = (Drawing(np.zeros(target.hw), np.zeros((*target.hw, 2)), np.zeros(target.hw, bool)) for _ in "12")
    if triangles:
        draw_mesh(np.array(triangles), points, target, strict, loose)
    draw_footprints(depth, shown, right, down, points, world, source, target, strict, loose)
    same = np.isclose(strict.depth, loose.depth, rtol=1e-4) & np.isclose(strict.where, loose.where, atol=1e-2).all(-1)
    return Drawing(loose.depth, loose.where, ~same | strict.unsure | loose.unsure)


def draw_mesh(corners: np.ndarray, points: np.ndarray, target: Camera, strict: Drawing, loose: Drawing) -> None:
    """The nearest front-facing triangle on every ray; corners: N x 3 x (row, column)."""
    p, q, r = (points[corners[:, n, 0], corners[:, n, 1]] for n in range(3))
    front = np.einsum("ni,ni->n", p, np.cross(q, r))  # > 0: clockwise as seen from the camera
    normals = np.stack([np.cross(q, r), np.cross(r, p), np.cross(p, q)], 1)
    z = np.stack([p[:, 2], q[:, 2], r[:, 2]], 1)
    for row in range(target.height):
        for column in range(target.width):
            ray = np.array([(column + 0.5 - target.cx) / target.fx, (row + 0.5 - target.cy) / target.fy, 1.0])
            volumes = normals @ ray
            on_screen = volumes * z  # barycentric on the screen, up to scale
            inside = on_screen.min(1) / np.maximum(np.abs(on_screen.sum(1)), 1e-300)
            for drawing, least in ((strict, MARGIN), (loose, -MARGIN)):
                hits = np.flatnonzero((front > 0) & (inside >= least) & (volumes.sum(1) > 0))
                if not len(hits):
                    continue
                along = front[hits] / volumes[hits].sum(1)
                first = hits[along.argmin()]
                shares = volumes[first] / volumes[first].sum()
                drawing.depth[row, column] = along.min()
                drawing.where[row, column] = shares @ corners[first][:, ::-1]


def draw_footprints(
    depth: np.ndarray,
    shown: np.ndarray,
    right: np.ndarray,
    down: np.ndarray,
    points: np.ndarray,
    world: np.ndarray,
    source: Camera,
    target: Camera,
    strict: Drawing,
    loose: Drawing,
) -> None:
    """Squares for the pixels at the rim of the mesh, where they are clearly before the mesh or it is not there.

    Clearly: by 2 % and twice the steepest relative step to a joined neighbour, so never before the surface they belong to.
    A pixel that is seen from behind has none.

    A square has the source pixel's own size as seen from the target: at least one pixel, then centred on the pixel that
    the point falls into; at most 32.
    """
    x, y, _ = pixels_of(target, world)
    rows, columns = np.mgrid[: target.height, : target.width] + 0.5
    for drawing, grow in ((strict, -MARGIN), (loose, MARGIN)):
        meshed = drawing.depth.copy()
        for row, column in zip(*np.nonzero(shown)):
            if not is_rim(right, down, row, column):
                continue
            neighbours = joined_neighbours(shown, right, down, row, column)
            screen = [np.array([x[n] - x[row, column], y[n] - y[row, column]]) if n else None for n in neighbours]
            pairs = zip(screen, screen[1:] + screen[:1])
            turns = [a[0] * b[1] - a[1] * b[0] for a, b in pairs if a is not None and b is not None]
            if sum(turns) < 0:
                continue
            ahead = points[row, column, 2]
            steps = [abs(ahead / points[n][2] - 1) for n in neighbours if n]
            clear = 1.02 + 2 * max(steps, default=0)
            half = min(16.0, 0.5 * target.fx / source.fx * depth[row, column] / ahead)
            centre = x[row, column], y[row, column]
            if half <= 0.5:
                drawing.unsure |= near_border(centre, columns, rows)
                centre, half = (np.floor(centre[0]) + 0.5, np.floor(centre[1]) + 0.5), 0.25
            covered = np.maximum(abs(columns - centre[0]), abs(rows - centre[1])) <= half + grow
            before_mesh = (meshed == 0) | (ahead * clear < meshed)
            drawing.unsure |= covered & (abs(ahead * clear - meshed) < 1e-4 * ahead)
            wins = covered & before_mesh & ((drawing.depth == 0) | (ahead < drawing.depth))
            drawing.depth[wins] = ahead
            drawing.where[wins] = column, row


def joined_neighbours(
    shown: np.ndarray, right: np.ndarray, down: np.ndarray, row: int, column: int
) -> list[tuple[int, int] | None]:
    """The neighbours (right, lower, left, upper) that a pixel is joined to and that are before the camera, else None."""
    height, width = shown.shape
    found = [
        column + 1 < width and right[row, column] and (row, column + 1),
        row + 1 < height and down[row, column] and (row + 1, column),
        column > 0 and right[row, column - 1] and (row, column - 1),
        row > 0 and down[row - 1, column] and (row - 1, column),
    ]
    return [place if place and shown[place] else None for place in found]


def near_border(centre: tuple[float, float], columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The target pixels that a point close to a pixel's border may be counted to."""
    close = min(abs(value - round(value)) for value in centre) < MARGIN
    return close & (abs(columns - centre[0]) < 1) & (abs(rows - centre[1]) < 1)


def shade(drawing: Drawing, right: np.ndarray, down: np.ndarray, color: np.ndarray) -> np.ndarray:
    """Colour (float H x W x 3) of every drawn pixel: bilinear in its quad, without the corners that nothing joins."""
    out = np.zeros((*drawing.depth.shape, 3))
    for row, column in zip(*np.nonzero(drawing.depth)):
        out[row, column] = bilinear(*drawing.where[row, column], right, down, color)
    return out


def bilinear(u: float, v: float, right: np.ndarray, down: np.ndarray, color: np.ndarray) -> np.ndarray:
    """Colour at source column u, row v: of a pixel as it is, else the mean of its quad's corners that something joins."""
    height, width = color.shape[:2]
    left, upper = min(int(u), max(width - 2, 0)), min(int(v), max(height - 2, 0))
    if abs(u - round(u)) < 1e-6 and abs(v - round(v)) < 1e-6:
        return color[round(v), round(u)].astype(float)
    fu, fv = u - left, v - upper
    top, west, east, bottom = sides_of(right, down, upper, left)
    weights = [(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv]
    kept = [top or west, top or east, west or bottom, east or bottom]
    corners = [color[upper, left], color[upper, left + 1], color[upper + 1, left], color[upper + 1, left + 1]]
    total = sum(weight for weight, keep in zip(weights, kept) if keep)
    return np.sum([w / total * c.astype(float) for w, keep, c in zip(weights, kept, corners) if keep], 0)


def shade_finely(
    drawing: Drawing, right: np.ndarray, down: np.ndarray, color: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colour (float) of every drawn pixel, how many places of the source it is the mean of, and where rounding decides.

    Inside a surface (8 x 8 pixels joined) scipy's cubic spline, else `bilinear`. As many places along the row as the next
    pixel is source pixels on, rounded up, if more than 1.2 and at most 4 columns and rows; along the column likewise; one
    alone where a place lies in a quad that is not joined all round.
    """
    from scipy.ndimage import map_coordinates

    out, counts = np.zeros((*drawing.depth.shape, 3)), np.zeros(drawing.depth.shape, int)
    unsure = drawing.unsure.copy()
    for row, column in zip(*np.nonzero(drawing.depth)):
        steps = [step_to(drawing, row, column, *after) for after in ((row, column + 1), (row + 1, column))]
        lengths = [float(np.hypot(*step)) for step in steps]
        unsure[row, column] |= any(near_threshold(drawing, row, column, step) for step in steps)
        wide, high = (int(np.ceil(length)) if length > 1.2 else 1 for length in lengths)
        wide, high = min(wide, 4), min(high, 4)
        shifts = [
            ((x + 0.5) / wide - 0.5) * steps[0] + ((y + 0.5) / high - 0.5) * steps[1]
            for y in range(high)
            for x in range(wide)
        ]
        places = [drawing.where[row, column] + shift for shift in shifts]
        unsure[row, column] |= any(np.abs(place - np.round(place)).min() < 1e-3 for place in places)  # which quad?
        if not all(in_whole_quad(right, down, *place) for place in places):
            places = [drawing.where[row, column]]
        counts[row, column] = len(places)
        for u, v in places:
            if is_inside(right, down, int(v), int(u)):
                planes = color.astype(float).transpose(2, 0, 1)
                found = np.array([map_coordinates(plane, [[v], [u]], order=3, mode="mirror")[0] for plane in planes])
            else:
                found = bilinear(u, v, right, down, color)
            out[row, column] += found / len(places)
    return np.clip(out, 0, 255), counts, unsure


def step_to(drawing: Drawing, row: int, column: int, next_row: int, next_column: int) -> np.ndarray:
    """Source columns and rows on to the next target pixel; none where it is empty, outside or on another surface."""
    height, width = drawing.depth.shape
    if next_row >= height or next_column >= width or drawing.depth[next_row, next_column] == 0:
        return np.zeros(2)
    step = drawing.where[next_row, next_column] - drawing.where[row, column]
    return step if np.abs(step).max() <= 4 else np.zeros(2)


def near_threshold(drawing: Drawing, row: int, column: int, step: np.ndarray) -> bool:
    """May rounding, or a neighbour that is unsure, change how many places a step asks for?"""
    length = float(np.hypot(*step))
    around = drawing.unsure[row : row + 2, column : column + 2].any()
    edges = np.array([1.2, 2, 3, 4])
    return bool(around or np.abs(edges - length).min() < 1e-3 or np.abs(np.abs(step) - 4).min() < 1e-3)


def is_inside(right: np.ndarray, down: np.ndarray, upper: int, left: int) -> bool:
    """Are the 8 x 8 pixels round a quad there and all joined?"""
    height, width = right.shape[0], down.shape[1]
    if upper < 3 or left < 3 or upper + 4 >= height or left + 4 >= width:
        return False
    return all(all(sides_of(right, down, upper + y, left + x)) for y in range(-3, 4) for x in range(-3, 4))


def in_whole_quad(right: np.ndarray, down: np.ndarray, u: float, v: float) -> bool:
    """Does source column u, row v lie in a quad joined all round?"""
    height, width = right.shape[0], down.shape[1]
    return 0 <= u < width - 1 and 0 <= v < height - 1 and all(sides_of(right, down, int(v), int(u)))
