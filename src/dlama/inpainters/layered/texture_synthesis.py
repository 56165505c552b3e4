"""Texture: a picture with filled inverse depth and surface labels in, the hole's colours out, from the background only.

Every hole pixel is a smooth *base*, interpolated along its own surface, plus, on planes, *detail* copied from the same
plane by a 3D translation within it, so that bricks and planks go on in perspective. How much of the detail is believed is
measured: the correlation of the known texture with itself under that translation, which is its least-squares gain (see
`texture_shifts`).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dlama.errors import ShapeError
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.inpainters.layered.canvas import Bases, Canvas, Int32Array, Surface
from dlama.inpainters.layered.patch_offsets import detail_for

GREY = 128
"""Colour where nothing at all is known."""
SKY = (120, 145, 175)
"""Colour of a sky of which the picture shows nothing: a pale daylight blue."""
FEW = 12
"""Fewer known cells than this do not speak for a surface."""
SCREEN = 0.002
"""Pull of a base towards its surface's mean colour, per cell, against its neighbours' 4."""

DEPTH_SCREEN = 0.002
"""The same for what has no plane, towards the mean of everything there and behind: a small rim must not colour it all."""


def synthesize(
    color: UInt8Array,
    hole: BoolArray,
    inverse_depth: Float32Array,
    label: Int32Array,
    camera: Camera,
    *,
    seed: int = 0,
    sky: UInt8Array | None = None,
) -> UInt8Array:
    """Colour for the hole, from known pixels of the same surface; known pixels come back bit-identical.

    color: H x W x 3 uint8 (RGB; ignored in the hole). hole: H x W bool, True = to be filled. inverse_depth: H x W
    float32, 1/m, 0 = sky, filled everywhere. label: H x W int32, -1 = non-planar, 0 = sky, k >= 1 = the k-th plane,
    filled everywhere. camera gives K. sky: RGB of a sky of which this picture shows nothing. The same seed gives the
    same bits. Raises ShapeError.
    """
    _check(color, hole, inverse_depth, label, camera)
    out = np.array(color)
    if not hole.any():
        return out
    canvas = Canvas(
        np.ascontiguousarray(color),
        np.ascontiguousarray(hole),
        np.ascontiguousarray(inverse_depth, np.float32),
        np.ascontiguousarray(label, np.int32),
        camera,
    )
    out[hole] = GREY
    if not hole.all():
        out[hole & (canvas.label == 0)] = SKY if sky is None else sky
    rng = np.random.default_rng(seed)
    for surface in surfaces(canvas):
        if not surface.sources.any():
            continue
        bases = bases_for(canvas, surface)
        detail = detail_for(canvas, surface, bases, rng)
        canvas.kernels.paint(
            out,
            canvas.color,
            surface.pixels,
            canvas.inverse_depth,
            canvas.source,
            surface.kind,
            detail.axes,
            bases,
            canvas.cell,
            detail.pick,
            detail.gains,
            detail.shifts,
        )
    return out


def _check(color: UInt8Array, hole: BoolArray, inverse_depth: Float32Array, label: Int32Array, camera: Camera) -> None:
    """Refuse arrays that do not belong to one picture."""
    wanted = {"color": (*camera.hw, 3), "hole": camera.hw, "inverse_depth": camera.hw, "label": camera.hw}
    arrays: tuple[np.ndarray, ...] = (color, hole, inverse_depth, label)
    for name, array in zip(wanted, arrays):
        if array.shape != wanted[name]:
            raise ShapeError(f"{name} has shape {array.shape}; {wanted[name]} is wanted for this camera")
    if color.dtype != np.uint8 or hole.dtype != np.bool_:
        raise ShapeError(f"color is {color.dtype} and hole {hole.dtype}; uint8 and bool are wanted")


def surfaces(canvas: Canvas) -> Iterator[Surface]:
    """The hole, cut into surfaces: planes and sky of which enough is seen, and all the rest as one (label -1)."""
    holes = np.flatnonzero(canvas.hole)
    kinds = canvas.label.ravel()[holes]
    rest = np.ones(len(holes), np.bool_)
    for kind in np.unique(kinds[kinds >= 0]).tolist():
        sources, here = canvas.sources == kind, kinds == kind
        if sources.sum() >= FEW or kind == 0:
            rest &= ~here
            yield Surface(kind, holes[here], sources)
    if rest.any():
        yield Surface(-1, holes[rest], canvas.sources != -2)


def bases_for(canvas: Canvas, surface: Surface) -> Bases:
    """The smooth colour fields of one surface."""
    if surface.kind >= 0:
        return surface_bases(canvas, surface)
    base = depth_base(canvas, surface)
    return base, base


def depth_base(canvas: Canvas, surface: Surface) -> Float32Array:
    """Colours that flow in from the rim between neighbours of like depth whatever their label, never from nearer ones.

    Depth without a plane was interpolated from whatever surrounds it, so its colour is too.
    """
    from dlama.inpainters.layered.kernels import base_color as kernels

    colors, far = kernels.farthest(canvas.colors, canvas.depths, canvas.sources)
    known = kernels.even_out(colors, far, 2)
    base = known.copy()
    rows, cols = np.divmod(surface.pixels, canvas.hole.shape[1])
    flat = (rows // canvas.cell) * far.shape[1] + cols // canvas.cell
    depth = np.full(far.size, np.inf, np.float32)
    np.minimum.at(depth, flat, canvas.inverse_depth.ravel()[surface.pixels])
    inside = np.isfinite(depth).reshape(far.shape)
    depth = np.where(inside, depth.reshape(far.shape), far)
    cells = _rim_first(inside)
    mean, any_behind = _behind(known, depth.ravel()[cells], far)
    base.reshape(-1, 3)[cells] = np.where(any_behind[:, None], mean, GREY)
    kernels.spread(base, depth, (far >= 0) & ~inside, cells, mean, DEPTH_SCREEN * any_behind, 80)
    return kernels.skirt(base, depth, inside)


def _rim_first(inside: BoolArray) -> NDArray[np.int64]:
    """Flat indices of the cells inside, in order of their distance from the outside."""
    import cv2

    cells = np.flatnonzero(inside)
    distance = cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, 3)
    return cells[np.argsort(distance.ravel()[cells], kind="stable")]


def _behind(base: Float32Array, depth: Float32Array, far: Float32Array) -> tuple[NDArray[np.float64], BoolArray]:
    """For each of N inverse depths: mean colour (N x 3) of all known cells there and behind, and whether there are any."""
    known = far >= 0
    order = np.argsort(far[known], kind="stable")
    count = np.searchsorted(far[known][order], 1.1 * depth + 1e-6, side="right")
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(base[known][order], axis=0, dtype=np.float64)])
    return sums[count] / np.maximum(count, 1)[:, None], count > 0


def surface_bases(canvas: Canvas, surface: Surface) -> Bases:
    """A slightly and a strongly blurred picture of one surface's known cells, continued into the hole.

    First by a pyramid, then as a screened membrane (Laplace's equation).
    """
    import cv2

    from dlama.inpainters.layered.kernels import base_color as kernels

    weight = surface.sources.astype(np.float32)
    sums, weights = kernels.pull(canvas.colors * weight[..., None], weight)
    rows, cols = np.divmod(surface.pixels, canvas.hole.shape[1])
    cells = np.unique((rows // canvas.cell) * weights.shape[1] + cols // canvas.cell)
    known = weights > 0
    usable = known.copy()
    usable.ravel()[cells] = True
    cells = cells[~known.ravel()[cells]]
    grids = []
    for sigma in (2.0, 7.0):
        blurred, share = (cv2.GaussianBlur(a, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT) for a in (sums, weights))
        grids.append(_continued(np.asarray(blurred, np.float32), np.asarray(share, np.float32), usable, cells))
    return grids[0], grids[1]


def _continued(sums: Float32Array, weights: Float32Array, usable: BoolArray, cells: NDArray[np.int64]) -> Float32Array:
    """Weighted sums to values everywhere: pull to one cell, push back, then relax the unknown cells."""
    from dlama.inpainters.layered.kernels.base_color import pull, push, relax

    weights[weights < 1e-3] = 0
    sums[weights == 0] = 0
    ladder = [(sums, weights)]
    while max(ladder[-1][1].shape) > 1:
        ladder.append(pull(*ladder[-1]))
    top, top_weight = ladder.pop()
    value = (top / np.maximum(top_weight, np.float32(1e-9))[..., None]).astype(np.float32)
    mean = value[0, 0].astype(np.float64)
    for level in reversed(ladder):
        value = push(*level, value, 1.0)
    relax(value, usable, cells, mean, SCREEN, 40)
    return value
