"""A picture with depth and a click or a box in; the masks that the object meant may have out.

Supporting surfaces are removed, the tops of objects that the object stands on among them; the connected region around the
click stays. Where depth edges are misaligned with the picture, as a depth camera's are, colours decide in a band along its
border (`borders`). `choice` takes one of these masks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlama.errors import MaskError
from dlama.geometry.drawing.picture_edges import CLEARLY, edge_misalignment
from dlama.geometry.holes import (
    box_around,
    dilate_mask,
    morphological_open,
    nearest_known,
    regions_touching,
    sides_of,
    square,
)
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.perception.kernels.regions import join_regions
from dlama.perception.masks.borders import at_same_depth, snap_to_picture_edges
from dlama.perception.masks.prompt import NothingThereError, Pixel, Prompt, square_about
from dlama.perception.masks.supports import (
    Planes,
    find_planes_of_picture,
    find_supports,
    is_ground,
    is_in_front,
    is_level,
)

REACH_PX = 2
"""Largest distance in px within one piece: a spoke one pixel wide has gaps."""
SNAP_PX = 6
"""Radius in px in which a click finds the nearest piece: thin objects are hard to hit."""
OBJECT_GAP = 0.15
"""Largest relative depth difference of touching pieces of one object: a lamp's shade hangs before its pole."""
TOUCHING_PX = 3


def check_surfaces(rgbd: RGBD) -> None:
    """MaskError where no pixel has a depth."""
    if not rgbd.valid.any():
        raise MaskError("depth is missing or far everywhere, so no object stands apart; depth with values is expected")


@dataclass(frozen=True, eq=False)
class Measured:
    """A picture with depth that was measured or rendered, as objects are searched for in it."""

    rgbd: RGBD
    planes: Planes
    edge_offset: int
    """Misalignment of depth edges with the picture, px; 0: aligned."""

    @classmethod
    def of(cls, rgbd: RGBD) -> Measured:
        """Of a picture: its planes, and whether its depth edges are off."""
        planes = find_planes_of_picture(rgbd)
        misaligned = edge_misalignment(rgbd.color, rgbd.depth, rgbd.valid, rgbd.far)
        return cls(rgbd, planes, misaligned if misaligned >= CLEARLY else 0)


@dataclass(frozen=True, eq=False)
class Pieces:
    """The picture without its supporting planes, in connected pieces."""

    depth: Float32Array
    free: BoolArray
    """H x W, True where depth is valid and on no supporting plane."""
    label: NDArray[np.int32]
    """H x W number of each pixel's piece; undefined where not free."""
    support: BoolArray
    """H x W, True on supporting planes."""

    def at(self, pixel: Pixel) -> BoolArray:
        """H x W, True on the piece at a pixel; all False where there is none."""
        return self.free & (self.label == self.label[pixel]) & bool(self.free[pixel])


def merge_pieces(pieces: Pieces, start: BoolArray, gap: float) -> BoolArray:
    """`start` and, repeatedly, all pieces that belong to it. gap 0: `start` alone.

    gap: largest relative depth difference of touching pieces.
    """
    target = start.copy()
    while gap:
        chosen = find_touching(pieces, target, gap)
        if not chosen:
            break
        target |= pieces.free & np.isin(pieces.label, chosen)
    return target


def find_touching(pieces: Pieces, target: BoolArray, gap: float) -> list[int]:
    """Numbers of the pieces whose common border with `target` (H x W) has mostly similar depths."""
    distance, nearest = nearest_known(target)
    border = pieces.free & ~target & (distance <= TOUCHING_PX + 0.5)
    pixels = np.flatnonzero(border)
    depth = pieces.depth.ravel()
    here, there = depth[pixels], depth[nearest.ravel()[pixels]]
    numbers, which = np.unique(pieces.label.ravel()[pixels], return_inverse=True)
    close = np.bincount(which, np.abs(here - there) <= gap * np.minimum(here, there), len(numbers))
    lengths = np.bincount(which, minlength=len(numbers))
    # a stool before a bed touches it at its ground contact alone, a vase what lies behind the edge of its plinth
    return [int(n) for n in numbers[(close > 1) & (close >= 0.95 * lengths)]]


def rgbd_candidates(measured: Measured, prompt: Prompt) -> list[BoolArray]:
    """H x W masks that differ: of a click the object, the piece at it and a group of objects; none of a box. MaskError where no
    object is found: on sky, ground, missing depth."""
    if not prompt.clicks:
        return []
    support = find_supports_at(measured, prompt.on[0])
    with_stand = pieces = find_pieces(measured, support)
    seed = snap_to_piece(pieces, prompt.on[0])
    stands = find_stands(measured, pieces, seed)
    if stands.any():
        pieces = find_pieces(measured, support | stands)
    own = pieces.at(seed)
    group = merge_pieces(with_stand, with_stand.at(seed), 0.3)  # twice as far apart
    whole = drop_duplicates([merge_pieces(pieces, own, OBJECT_GAP), own, group])
    return drop_duplicates([finish_mask(measured, mask) for mask in whole])


def find_supports_at(measured: Measured, pixel: Pixel) -> BoolArray:
    """H x W, the planes that support the object at a click. MaskError where it is on none."""
    rgbd, found = measured.rgbd, measured.planes
    check_surfaces(rgbd)
    if not (rgbd.far[pixel] or is_ground(found, *pixel)):
        return find_supports(found, pixel)
    support = find_supports(found)
    if not (rgbd.valid & ~support)[square_about(pixel, SNAP_PX)].any():
        what = "the sky" if rgbd.far[pixel] else "a plain surface (ground, wall or table)"
        raise NothingThereError(pixel, f"which lies on {what}: nothing stands apart there")
    return support


def find_pieces(measured: Measured, support: BoolArray) -> Pieces:
    """The connected pieces that remain without the supporting planes."""
    rgbd, noise = measured.rgbd, measured.planes.noise
    free = rgbd.valid & ~support
    reach = range(-REACH_PX, REACH_PX + 1)
    near = [(r, c) for r in range(REACH_PX + 1) for c in reach if (r, c) > (0, 0) and r * r + c * c <= REACH_PX**2 + 1]
    offsets = np.array(near, np.int64)
    apart = np.hypot(offsets[:, 0], offsets[:, 1])
    focal = min(rgbd.camera.fx, rgbd.camera.fy)
    # relative: 1 % and four standard deviations of the noise, and 4 for each metre between the two: a surface at 76 degrees
    step = 0.01 + 4 * noise * (float(np.median(rgbd.depth[rgbd.valid])) if noise else 0.0)
    allowed = (step + np.where(apart < 1.5, 4.0, 4.0 / 3) * apart / focal).astype(np.float32)
    parent = np.arange(free.size, dtype=np.int32)
    join_regions(rgbd.depth, free, offsets, allowed, parent)
    return Pieces(rgbd.depth, free, parent.reshape(free.shape), support)


def find_stands(measured: Measured, pieces: Pieces, seed: Pixel) -> BoolArray:
    """H x W, True on the tops of objects that the object at a pixel stands on (a table, a plinth, a traffic island): level
    planes below it that touch it (depths differ by 3 % at most) and are wider: the seat of a chair is as wide as its back. Bands
    narrower than 5 px are where a plane cuts another surface."""
    found = measured.planes
    out = np.zeros(pieces.free.shape, np.bool_)
    for number in range(len(found.planes)):
        if not is_level(found, number, measured.rgbd.camera) or not is_in_front(found, number, seed):
            continue
        top = found.label == number + 1
        if (top & pieces.support).any() or top[seed]:
            continue
        on_it = find_pieces(measured, pieces.support | out | top).at(seed)
        contact = dilate_mask(on_it, TOUCHING_PX) & at_same_depth(found, on_it, 0.03)
        touching = regions_touching(morphological_open(top, square(5)), contact)
        if touching.any() and sides_of(box_around(touching, 0))[1] >= 1.3 * sides_of(box_around(on_it, 0))[1]:
            out |= top
    return out


def snap_to_piece(pieces: Pieces, seed: Pixel) -> Pixel:
    """The pixel itself if it lies on a piece, else the nearest pixel of one; MaskError where none is near."""
    if pieces.free[seed]:
        return seed
    distance, nearest = nearest_known(pieces.free)
    if not distance[seed] <= SNAP_PX * 1.5:
        raise NothingThereError(seed, "where depth shows nothing that stands apart")
    row, column = divmod(int(nearest[seed]), pieces.free.shape[1])
    return row, column


def finish_mask(measured: Measured, mask: BoolArray) -> BoolArray:
    """The mask with its border on the picture's edges."""
    rgbd, offset = measured.rgbd, measured.edge_offset
    unknown = rgbd.missing & dilate_mask(mask, 12)  # px by which it may grow into missing depth
    return snap_to_picture_edges(rgbd, mask, offset + 1 if offset else 0, unknown)


def drop_duplicates(masks: list[BoolArray]) -> list[BoolArray]:
    """Masks that differ from earlier ones by at least 1 % of their pixels."""
    out: list[BoolArray] = []
    for mask in masks:
        if all((mask ^ other).sum() > 0.01 * (mask | other).sum() for other in out):
            out.append(mask)
    return out
