"""Extension: a view's known surfaces in; inverse depth and a surface label for every hole pixel out.

Ground and walls go on as the planes they are, the sky goes on as sky, what is neither is interpolated from the far side of
the hole. Which surface goes on where is a labelling problem on a coarse grid: surfaces reach out from where they were last
seen, meet where their planes intersect, may be hidden by what is known but not hide it (the visibility law).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.holes import nearest_known, with_nearest
from dlama.geometry.projection import inverse_depth, rays
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.geometry.view import HoleType, View
from dlama.geometry.visibility import Law
from dlama.inpainters.layered.planes import SMOOTH, denoised, find_planes, label_known, noise_level, plane_values

GRID = 256
"""Longer side of the coarse grid."""
ROUNDS = 4
"""Sweeps of belief propagation; more change less than 0.5 % of the labels."""
SMOOTH_PENALTY = 0.25
POTTS = 0.1
"""Cost of a border between two surfaces that meet; one that jumps costs 1 more."""
RIM = (0.05, 0.3, 1.0, 3.0)
"""Cost at the rim of the hole of a surface that meets the known one, is hidden by it, is hidden sky, stands before it."""
REACH = 0.05
"""Share of the picture's longer side at which a surface last seen that much farther off costs one full jump."""
FAR_SAMPLES = 256
"""Far directions that stand for all of a source camera's."""
LEEWAY = 1.03
"""Relative depth by which a plane may break the visibility law and still be meant."""
RANGE_COST = 6.0
"""Cost of a plane e times nearer or farther than anything known."""
ORDER_COST = 3.0
"""Cost of a surface behind a plane that it is nowhere seen behind."""
OUT_OF_ORDER = 0.02
"""Share of a surface's known cells up to which it counts as nowhere seen behind a plane: noise, bad labels."""
BEFORE = 1.05
"""Relative inverse depth from which one plane stands before another."""
FEW = 50
"""Fewer known cells say nothing about the order of surfaces."""
LEAST_INVERSE_DEPTH = 1e-3
"""Planes are not continued beyond 1 km: there they are horizon."""


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Inverse depth and surface label of every pixel of a view, known and filled."""

    inverse_depth: Float32Array
    """H x W, 1/m; 0 = far. Known pixels on planes are freed of the noise that was measured."""
    label: NDArray[np.int32]
    """H x W; -1 = no plane, 0 = sky, k = k-th plane."""
    planes: NDArray[np.float64]
    """K x 3, w = a u + b v + c in pixels of the view."""


def extend(view: View, law: Law, seed: int = 0) -> Surfaces:
    """Continue the known surfaces of a view into its holes."""
    w = inverse_depth(np.where(view.hole, np.float32(0), view.depth))
    noise = noise_level(w, view.valid)
    planes = find_planes(w, view.valid, seed, noise)
    label = label_known(w, view.valid, view.far, planes, noise)
    w = denoised(w, label, planes, noise)
    step = max(1.0, max(w.shape) / GRID)
    coarse = Coarse.of(view, w, label, planes, step)
    belief = coarse.beliefs(law)
    return fine_surfaces(view, w, label, planes, coarse, belief)


@dataclass(frozen=True, eq=False)
class Coarse:
    """The view on a grid of at most GRID cells: one sample of each cell."""

    camera: Camera
    hole: BoolArray
    inner: BoolArray
    """The part of the hole that is inside the source's view."""
    w: Float32Array
    label: NDArray[np.int32]
    values: Float32Array
    """L x h x w inverse depth that each label would give: no plane, sky, planes."""
    step: float

    @classmethod
    def of(
        cls, view: View, w: Float32Array, label: NDArray[np.int32], planes: NDArray[np.float64], step: float
    ) -> Coarse:
        from dlama.inpainters.layered.kernels import surfaces as extension_kernels

        camera = shrunk(view.camera, step)
        rows, columns = (
            np.minimum(((np.arange(n) + 0.5) * step).astype(np.int64), size - 1) for n, size in zip(camera.hw, w.shape)
        )
        pick = np.ix_(rows, columns)
        hole = touched(view.hole, camera.wh)
        smooth = extension_kernels.far_side(w[pick], hole)
        values = np.concatenate([smooth[None], np.zeros_like(smooth)[None], plane_values(planes, camera.hw, step)])
        inner = hole & touched(view.hole & (view.hole_type != HoleType.OUT_OF_VIEW), camera.wh)
        return cls(camera, hole, inner, w[pick], label[pick], values.astype(np.float32), step)

    def beliefs(self, law: Law) -> Float32Array:
        """h x w x L cost of each label after belief propagation (lower is better)."""
        from dlama.inpainters.layered.kernels import surfaces as extension_kernels

        penalty = self.beyond_range()
        penalty[0] += SMOOTH_PENALTY
        penalty[1:] += ORDER_COST * self.out_of_order()
        unary = extension_kernels.unary_costs(
            self.values,
            self.allowed(law),
            self.distances(law),
            self.hole,
            self.w,
            self.label,
            REACH * GRID,
            penalty,
            np.array(RIM),
        )
        return extension_kernels.beliefs(unary, self.values, self.hole, POTTS, ROUNDS)

    def allowed(self, law: Law) -> BoolArray:
        """L x h x w, False where a label is impossible: behind the camera, never seen, or against the law by over 3 %."""
        out = np.ones(self.values.shape, np.bool_)
        known = ~self.hole
        for number, value in enumerate(self.values):
            seen = number == 0 or (self.label[known] == number - 1).any() or (number == 1 and law.has_far)
            possible = value > LEAST_INVERSE_DEPTH if number > 1 else value >= 0
            if number == 0:
                possible = value > 0
            out[number] = possible & seen
            if number != 1:
                depth = np.where(possible, LEEWAY / np.maximum(value, 1e-6), np.inf).astype(np.float32)
                out[number] &= ~law.violations(self.camera, depth, self.hole & possible)
        return out

    def beyond_range(self) -> Float32Array:
        """L x h x w cost of planes nearer or farther than all that is known: extrapolation is less sure the farther it goes."""
        cost = np.zeros(self.values.shape, np.float32)
        finite = self.w[~self.hole & (self.w > 0)]
        if finite.size:
            farthest, nearest = np.quantile(finite, (0.02, 0.98))
            planes = np.maximum(self.values[2:], LEAST_INVERSE_DEPTH)
            cost[2:] = RANGE_COST * np.maximum(0, np.maximum(np.log(planes / nearest), np.log(farthest / planes)))
        return cost

    def out_of_order(self) -> BoolArray:
        """(L - 1) x h x w, True where sky or a plane would stand behind a plane that it is nowhere seen behind.

        A wall that meets the ground shows only above it, though its plane goes on below; that of a box goes on above the box, and
        the wall behind is seen there all the same. Which of the two it is, the known pixels say. Out of view they say nothing.
        """
        out = np.zeros((len(self.values) - 1, *self.hole.shape), np.bool_)
        for back in range(len(out)):
            seen = ~self.hole & (self.label == back)
            if seen.sum() < FEW:
                continue
            for front in range(1, len(out)):
                before = self.values[front + 1] > BEFORE * self.values[back + 1] + LEAST_INVERSE_DEPTH
                if front != back and before[seen].mean() < OUT_OF_ORDER:
                    out[back] |= before
        return out & self.inner

    def distances(self, law: Law) -> Float32Array:
        """L x h x w, cells to the nearest known cell of each label (a large number if there is none).

        For the sky also the angle to where a source camera saw it, which may be outside this view.
        """
        import cv2

        out = np.full(self.values.shape, 1e3, np.float32)
        for number in range(len(self.values)):
            there = ~self.hole & (self.label == number - 1)
            if there.any():
                out[number] = cv2.distanceTransform((~there).astype(np.uint8), cv2.DIST_L2, 5)
        if law.has_far:
            angle = angle_to_far(shrunk(self.camera, 4), law)  # smooth: a quarter of the cells is enough
            out[1] = np.minimum(out[1], self.camera.fx * enlarged(angle, self.camera.wh))
        return out


def angle_to_far(camera: Camera, law: Law) -> Float32Array:
    """H x W radians between each pixel's direction and the nearest direction in which a source camera saw far pixels."""
    directions = rays(camera) @ camera.world_from_cam[:3, :3].T
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    nearest = np.full(camera.hw, -1.0)
    for source, measured in law.measured:
        rows, columns = np.nonzero(np.isposinf(measured))
        some = slice(None, None, max(1, len(rows) // FAR_SAMPLES))
        far = rays(source)[rows[some], columns[some]] @ source.world_from_cam[:3, :3].T
        far /= np.linalg.norm(far, axis=1, keepdims=True)
        for block in range(0, len(far), 32):
            np.maximum(nearest, (directions @ far[block : block + 32].T).max(2), out=nearest)
    return np.arccos(np.clip(nearest, -1, 1)).astype(np.float32)


def touched(hole: BoolArray, wh: tuple[int, int]) -> BoolArray:
    """Coarse cells that hold a hole pixel, so that a hole one pixel wide is not missed."""
    import cv2

    return cv2.resize(hole.astype(np.float32), wh, interpolation=cv2.INTER_AREA) > 0


def shrunk(camera: Camera, step: float) -> Camera:
    """The camera with pixels `step` times as large."""
    width, height = max(1, round(camera.width / step)), max(1, round(camera.height / step))
    return dataclasses.replace(
        camera,
        width=width,
        height=height,
        fx=camera.fx / step,
        fy=camera.fy / step,
        cx=camera.cx / step,
        cy=camera.cy / step,
    )


def fine_surfaces(
    view: View,
    w: Float32Array,
    label: NDArray[np.int32],
    planes: NDArray[np.float64],
    coarse: Coarse,
    belief: Float32Array,
) -> Surfaces:
    """Coarse beliefs interpolated to every hole pixel; each takes the label of least cost and its inverse depth."""
    spread = with_nearest(belief, coarse.hole)
    best = np.full(w.shape, np.inf, np.float32)
    chosen = np.full(w.shape, SMOOTH, np.int32)
    for number in range(belief.shape[2]):
        cost = enlarged(spread[..., number], view.camera.wh)
        better = cost < best
        best[better] = cost[better]
        chosen[better] = number - 1
    rows, columns = np.nonzero(view.hole)
    labels = chosen[rows, columns]
    smooth = enlarged(with_nearest(coarse.values[0], coarse.hole & (coarse.values[0] > 0)), view.camera.wh)
    of_label = np.concatenate([np.zeros((1, 3)), planes])[np.maximum(labels, 0)]
    on_plane = of_label[:, 0] * (columns + 0.5) + of_label[:, 1] * (rows + 0.5) + of_label[:, 2]
    on_plane = np.maximum(0, on_plane + anchor(view.hole, w, label, planes, labels))
    out, filled = w.copy(), label.copy()
    out[rows, columns] = np.where(labels == SMOOTH, smooth[rows, columns], np.where(labels > 0, on_plane, 0))
    filled[rows, columns] = labels
    return Surfaces(out, filled, planes)


def enlarged(values: Float32Array, wh: tuple[int, int]) -> Float32Array:
    """A coarse picture bilinearly enlarged to the view."""
    import cv2

    return np.asarray(
        cv2.resize(np.ascontiguousarray(values, np.float32), wh, interpolation=cv2.INTER_LINEAR), np.float32
    )


def anchor(
    hole: BoolArray, w: Float32Array, label: NDArray[np.int32], planes: NDArray[np.float64], labels: NDArray[np.int32]
) -> NDArray[np.float64]:
    """What a plane misses of its nearest known pixel, fading out over 16 px, for each hole pixel: no step at the rim.

    labels: the label of each hole pixel, in row-major order; only a known pixel of the same plane anchors.
    """
    import cv2

    # the pixel at the very rim is a footprint half a pixel off its surface: anchor on the one behind it
    inner = cv2.erode((~hole).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    distance, source = nearest_known(inner if inner.any() else ~hole)
    source = source[hole]
    rows, columns = np.divmod(source, hole.shape[1])
    same = (label.ravel()[source] == labels) & (labels > 0)
    of_label = np.concatenate([np.zeros((1, 3)), planes])[np.maximum(labels, 0)]
    fitted = of_label[:, 0] * (columns + 0.5) + of_label[:, 1] * (rows + 0.5) + of_label[:, 2]
    return np.where(same, (w.ravel()[source] - fitted) * np.exp(-distance[hole] / 16), 0)
