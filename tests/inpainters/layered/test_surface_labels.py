"""The order of surfaces: which plane may go on behind which inside a hole, as the known pixels say."""

from __future__ import annotations

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.projection import inverse_depth
from dlama.geometry.view import HoleType, View
from dlama.inpainters.layered.surface_labels import IN_FRONT, LEAST_INVERSE_DEPTH, CoarseView
from dlama.perception.planes import SKY, find_planes, label_known
from worlds import Box, Plane, World


def floor_and_wall(kind: HoleType, in_front: Box | None = None) -> tuple[CoarseView, np.ndarray]:
    """A floor that meets a wall, a tall hole across the seam, and rows from the floor down to the wall's last row there."""
    camera = Camera.from_fov(128, 96, 60)
    shapes = (Plane((0, 1, 0), (0, 1, 0)), Plane((0, 0, 5), (0, 0, -1)))
    view = View.from_rgbd(World(shapes if in_front is None else (*shapes, in_front)).rgbd(camera))
    hole = np.zeros(camera.hw, bool)
    hole[20:90, 50:80] = True
    w, view = inverse_depth(view.depth), view.without(hole, kind)
    planes = find_planes(w, view.valid, 0)
    coarse = CoarseView.of(view, w, label_known(w, view.valid, view.far, planes), planes, 1.0)
    return coarse, World(shapes).trace(camera)[1]


def test_a_wall_does_not_go_on_below_the_ground_it_meets() -> None:
    """Closed form: in the hole the wall is out of order where the floor is nearer by IN_FRONT, the floor where the wall is;
    the sky, of which nothing is seen, nowhere; and out of view nobody knows."""
    coarse, number = floor_and_wall(HoleType.OBJECT)
    order = coarse.out_of_order()
    floor, wall = (1 + int(np.bincount(coarse.label[~coarse.hole & (number == n)]).argmax()) for n in (0, 1))
    for back, front in ((wall, floor), (floor, wall)):
        behind = coarse.candidates[front] > IN_FRONT * coarse.candidates[back] + LEAST_INVERSE_DEPTH
        np.testing.assert_array_equal(order[back - 1], behind & coarse.hole)
        assert order[back - 1].sum() > 200
    assert not order[SKY].any()
    assert not floor_and_wall(HoleType.OUT_OF_VIEW)[0].out_of_order().any()


def test_a_wall_seen_above_a_box_is_not_out_of_order_behind_it() -> None:
    """Law: the plane of a box's face goes on above the box, where the wall is seen: the wall may stand behind it."""
    coarse, number = floor_and_wall(HoleType.OBJECT, Box((-1.5, 0.3, 3), (1.5, 1, 3.4)))
    wall = 1 + int(np.bincount(coarse.label[~coarse.hole & (number == 1)].clip(0)).argmax())
    faces = [k for k, value in enumerate(coarse.candidates) if k > 1 and abs(value[0, 0] * 3 - 1) < 0.02]
    assert len(faces) == 1
    alone = coarse.candidates[faces[0]] > IN_FRONT * coarse.candidates[wall] + LEAST_INVERSE_DEPTH
    assert (alone & coarse.hole & ~coarse.out_of_order()[wall - 1])[20:40].any()
