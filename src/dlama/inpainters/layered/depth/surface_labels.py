"""The known surfaces of a coarse grid in; the cost of each surface in each of its cells out.

A labelling problem, solved by belief propagation. Surfaces extend from where they were last seen, meet where their planes
intersect, and may be hidden by known pixels but not hide them (the visibility law).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.holes import dilate_mask, distance_to, regions_touching
from dlama.geometry.kernels.jit import begin_job
from dlama.geometry.projection import rays
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.visibility import Law
from dlama.inpainters.context import FillContext
from dlama.inpainters.layered.depth.cut_objects import CutObjects
from dlama.inpainters.layered.depth.out_of_view import (
    FOLLOWED,
    IN_FRONT,
    CoarseCells,
    PlaneLines,
    above_horizon,
    continue_between,
    ending_cost,
    follow_lines,
)
from dlama.inpainters.layered.depth.plane_edges import align_lines_to_edges
from dlama.inpainters.layered.kernels import surfaces as surface_kernels
from dlama.perception.planes import SKY, SMOOTH
from dlama.perception.resampling import interpolate

GRID = 256
"""Longer side of the coarse grid."""
POTTS = 0.1
"""Cost of a border between two surfaces that meet; one with a depth jump costs 1 more."""
RIM = (0.05, 0.3, 1.0, 3.0)
"""Cost at the rim of a surface that meets the known one, is hidden by it, is hidden sky, is in front of it."""
REACH = 0.05
"""Distance to the last seen pixel of a surface, over the picture's longer side, that costs one full jump."""
AROUND = 31
"""Width, in cells, of a cell's surroundings."""
LEEWAY = 1.03
"""Relative depth by which a plane may break the visibility law and still be a candidate."""


@dataclass(frozen=True, eq=False)
class CoarseView(CoarseCells):
    """A view on a grid of at most GRID cells a side, and how far its surfaces extend."""

    cut: CutObjects
    """Extents of objects without a plane out of view."""
    followed_from: float = FOLLOWED
    """Least share of the known cells of a plane that is followed along lines out of view."""
    solid: bool = False
    """Whether followed planes also need visible runs of 25 cells along rows and columns (geometric mean of their means): with
    inexact depth edges slats end anywhere."""
    removed: BoolArray | None = None
    """h x w, True in the part of the hole where an object was removed."""

    def label_costs(self, context: FillContext) -> Float32Array:
        """h x w x L cost of each label after belief propagation (lower is better)."""
        distances = begin_job(self.distance_to_known, context)
        followed = self.followed_planes()
        lines = align_lines_to_edges(PlaneLines.of(self, self.seen_through(context, followed)), self)
        followed |= lines.by_edges
        on, penalty = follow_lines(lines, self, followed, context.sky is not None)
        if self.removed is not None:
            between, hidden = continue_between(lines, self, followed, self.removed)
            on, penalty = np.maximum(on, between), penalty + hidden
        penalty += ending_cost(self, followed, self.cut.beyond, REACH * GRID)
        penalty[0] += 0.25  # no plane, wherever a plane or the sky is possible
        penalty[1:] += np.float32(3) * self.out_of_order()
        distance = distances()
        distance += on * (distance.min(0) - distance)  # what is seen on its line is as near as anything
        unary = self.unary_costs(self.allowed(context), distance, penalty)
        costs = surface_kernels.beliefs(unary, self.candidates, self.hole, POTTS, 4)  # more change 0.5 % of the labels
        costs[self.floating(costs.argmin(2) - 1), SKY + 1] = -1  # below any other
        return costs

    def floating(self, label: NDArray[np.intp]) -> BoolArray:
        """h x w, True in parts of the hole that hang in the sky: they touch neither a known surface nor the border of the view.

        label: h x w, of each hole cell.
        """
        solid = np.where(self.hole, label, self.label) != SKY
        held = solid & ~self.hole
        held[[0, -1]] = held[:, [0, -1]] = True
        return solid & self.hole & ~regions_touching(solid, held)

    def unary_costs(self, allowed: BoolArray, distance: Float32Array, penalty: Float32Array) -> Float32Array:
        """h x w x L unary cost of each label in each hole cell: distance to where the surface was last seen, and the rim.

        allowed, penalty (further cost): L x h x w; distance: L x h x w cells to the nearest known cell of a label.
        """
        rows, columns = np.nonzero(self.hole)
        values, away = (each[:, rows, columns].astype(np.float64) for each in (self.candidates, distance))
        cost = penalty[:, rows, columns] + (away - away.min(0)) / (REACH * GRID)
        cost[~allowed[:, rows, columns]] += 50
        known, w, label = (np.pad(each, 1) for each in (~self.hole, self.inverse_depth, self.label))
        for down, right in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            there = rows + 1 + down, columns + 1 + right
            rim = known[there]
            cost[:, rim] += rim_cost(values[:, rim], w[there][rim], label[there][rim])
        out = np.zeros((*self.hole.shape, len(values)), np.float32)
        out[rows, columns] = cost.T
        return out

    def allowed(self, context: FillContext) -> BoolArray:
        """L x h x w, False where a label is impossible: behind the camera, never seen, against the law by over 3 %, or sky with
        walls all round."""
        out = np.ones(self.candidates.shape, np.bool_)
        shown = np.unique(self.label[~self.hole])
        for number, value in enumerate(self.candidates):
            seen = number == 0 or number - 1 in shown or (number == 1 and context.sky is not None)
            possible = value > self.horizon if number > 1 else (value > 0) | (number == 1)
            out[number] = possible & seen
            if number != 1:
                depth = np.where(possible, LEEWAY / np.maximum(value, 1e-6), np.inf).astype(np.float32)
                out[number] &= ~context.law.violations(self.camera, depth, self.hole & possible)
        out[1] &= ~self.enclosed_by_surfaces()
        return out

    def enclosed_by_surfaces(self) -> BoolArray:
        """h x w, True in parts of the hole that neither meet known sky nor leave the view: a wall has no window onto the sky."""
        known_sky = ~self.hole & (self.label == SKY)
        return self.hole & ~regions_touching(self.hole, self.unseen | dilate_mask(known_sky, 2))

    def seen_through(self, context: FillContext, followed: BoolArray) -> BoolArray:
        """K x h x w, True in hole cells in which a source camera saw the sky through a followed plane (K): it has ended there."""
        out = np.zeros((len(followed), *self.hole.shape), np.bool_)
        if context.sky is None or not followed.any():
            return out
        far = context.law.of_far()
        for k in np.flatnonzero(followed):
            there = self.hole & (self.candidates[k + 2] > self.horizon)
            depth = LEEWAY / np.maximum(self.candidates[k + 2], np.float32(self.horizon))
            out[k] = far.violations(self.camera, depth.astype(np.float32), there)
        return out

    def out_of_order(self) -> BoolArray:
        """(L - 1) x h x w, True where sky or a plane would lie behind a plane that it is never seen behind.

        A wall that meets the ground is visible only above it, though its plane continues below. The plane of a box's front also
        continues above the box, but there the wall behind is visible. The known pixels decide; out of view they cannot.
        """
        out = np.zeros((len(self.candidates) - 1, *self.hole.shape), np.bool_)
        for back in range(len(out)):
            seen = ~self.hole & (self.label == back)
            if seen.sum() < 50:
                continue
            for front in range(1, len(out)):
                before = self.candidates[front + 1] > IN_FRONT * self.candidates[back + 1] + self.horizon
                if front != back and before[seen].mean() < 0.02:  # noise, wrong labels
                    out[back] |= before
        return out & self.hole_in_view

    def followed_planes(self) -> BoolArray:
        """K bool, the planes that are followed along lines out of view: the large ones, or the large and `solid`."""
        out = np.asarray(self.plane_cells >= self.followed_from * (~self.hole).sum())
        for k in np.flatnonzero(out & self.solid):
            along, across = mean_chords(~self.hole & (self.label == k + 1))
            out[k] = along * across >= 25**2
        return out

    def distance_to_known(self, context: FillContext) -> Float32Array:
        """L x h x w, cells to the nearest known cell of each label (a large number if there is none).

        In view, what stands out of a plane a little counts as that plane. For the sky the angle to where a source camera saw it
        counts, too, also outside this view. Out of view and above the horizon it counts at most one full jump more than the
        nearest label.
        """
        out = np.full(self.candidates.shape, 1e3, np.float32)
        surrounded = self.with_relief()
        for number in range(len(self.candidates)):
            there = ~self.hole & (self.label == number - 1)
            if there.any():
                out[number] = distance_to(there)
                larger = ~self.hole & (surrounded == number - 1)
                if (larger != there).any():
                    within = distance_to(larger) if larger.any() else np.float32(1e3)
                    np.copyto(out[number], within, where=self.hole_in_view)
        if context.sky is not None:
            coarser = self.camera.with_larger_pixels(4)  # smooth: a quarter of the cells is enough
            angle = angle_to_far(coarser, context.law)
            out[1] = np.minimum(out[1], self.camera.fx * interpolate(angle, self.camera.hw))
            open_air = self.unseen & above_horizon(self)
            out[1] = np.where(open_air, np.minimum(out[1], out.min(0) + REACH * GRID), out[1])
        return out

    def with_relief(self) -> NDArray[np.int8]:
        """h x w labels, with cells of no plane that lie within 6 % of a plane that is most of, and .3 of, their surroundings (a
        door, a sill) assigned to it."""
        out = self.label.copy()
        loose = ~self.hole & (self.label == SMOOTH) & (self.inverse_depth > 0)
        most = np.full(self.label.shape, 0.3 * AROUND**2, np.float32)
        for number, value in enumerate(self.candidates[2:], start=1):
            on = (self.label == number) & ~self.hole
            count = cv2.boxFilter(on.astype(np.float32), -1, (AROUND, AROUND), normalize=False)
            near = loose & (np.abs(value - self.inverse_depth) < 0.06 * self.inverse_depth) & (count > most)
            out[near], most[near] = number, count[near]
        return out


def rim_cost(values: Float64Array, known: Float32Array, known_label: NDArray[np.int8]) -> Float64Array:
    """L x N cost of each label's inverse depth (L x N) next to N known cells: 0 for the same surface, else as RIM says, in full
    from a step of 13 % on."""
    label = np.arange(len(values))[:, None] - 1
    step = np.maximum(values, known) / np.maximum(np.minimum(values, known), 1e-9)
    share = np.clip((step - 1.03) / 0.1, 0, 1)  # noise of a few per cent is no step
    meets, hidden, sky_hidden, in_front = RIM
    full = np.where(values > known, in_front, np.where(label == SKY, sky_hidden, hidden))
    return np.where((label == known_label) & (label >= 0), 0.0, meets + full * share)


def mean_chords(there: BoolArray) -> tuple[float, float]:
    """Mean length of the runs of True along columns and along rows of an h x w grid, over the cells in them."""
    chords = []
    for lines in (there.T, there):
        apart = np.zeros((len(lines), lines.shape[1] + 1), np.bool_)  # one run ends where another line begins
        apart[:, 1:] = lines
        ends = np.flatnonzero(np.diff(apart.ravel(), append=False))
        length = (ends[1::2] - ends[::2]).astype(np.float64)
        chords.append(float((length**2).sum() / max(length.sum(), 1)))
    return chords[0], chords[1]


def angle_to_far(camera: Camera, law: Law) -> Float32Array:
    """H x W radians between each pixel's direction and the nearest direction in which a source camera saw far pixels."""
    directions = rays(camera) @ camera.world_from_cam[:3, :3].T
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    nearest = np.full(camera.hw, -1.0)
    for source, measured in law.measured:
        places = np.flatnonzero(np.isposinf(measured))
        rows, columns = np.divmod(places[:: max(1, len(places) // 256)], source.width)
        x, y = (columns + 0.5 - source.cx) / source.fx, (rows + 0.5 - source.cy) / source.fy
        far = np.stack([x, y, np.ones(len(x))], 1) @ source.world_from_cam[:3, :3].T
        far /= np.linalg.norm(far, axis=1, keepdims=True)
        for block in range(0, len(far), 32):
            np.maximum(nearest, (directions @ far[block : block + 32].T).max(2), out=nearest)
    return np.arccos(np.clip(nearest, -1, 1)).astype(np.float32)
