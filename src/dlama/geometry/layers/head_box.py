"""A source view in; the head box of a 3-D photo out: all cameras near the source that the photo may be looked at from."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from dlama.arguments import is_finite
from dlama.errors import DepthError, InputError
from dlama.geometry.camera import Camera
from dlama.geometry.motion.poses import transform_points
from dlama.geometry.motion.trajectories import dolly, orbit
from dlama.geometry.projection import inverse_depth, project
from dlama.geometry.view import View

PARALLAX = 0.04
"""Share of the picture's width by which the median pixel moves between the left and the right end of the box."""
WIDEST = 0.3
"""Share of its size by which the picture of the wide camera grows at each side, at most."""
BEHIND, TOWARDS = 0.1, 0.66
"""Share of the surfaces that the default box may see from behind, such as a floor; and of the way there that it may go."""
SIDES = (-1.0, 0.0, 1.0)


@dataclass(frozen=True)
class HeadBox:
    """All cameras within `angle` degrees of yaw and pitch about the pivot, and `distance` forward and back.

    Raises InputError: an angle outside 0..45, a distance outside 0..0.9, a pivot that is not positive.
    """

    camera: Camera
    """The source camera, in the middle of the box."""
    pivot: float
    """Metres ahead on the optical axis: what the cameras look at."""
    angle: float
    """Degrees to either side, up and down."""
    distance: float
    """Share of the pivot's distance, forward and back."""

    def __post_init__(self) -> None:
        for name, most in (("angle", 45.0), ("distance", 0.9)):
            if not is_finite(getattr(self, name)) or not 0 <= getattr(self, name) <= most:
                raise InputError(f"`{name}` is {getattr(self, name)!r}; a number from 0 to {most:g} is expected")
        if not is_finite(self.pivot) or self.pivot <= 0:
            raise InputError(f"`pivot` is {self.pivot!r}; a distance > 0 in metres is expected")

    @classmethod
    def of(cls, view: View, angle: float | None = None, distance: float | None = None) -> HeadBox:
        """The box about a view, its pivot at the median depth.

        angle: degrees; None: so that the median parallax between its left and right end is PARALLAX of the width, and so that no
            camera comes to the back of large surfaces (`way_to_back`): under the floor.
        distance: share of the pivot's distance; None: half of what `angle` moves to the side, but no more than 0.3 of the way to
            the nearest surface (2 % of the depth are nearer).
        DepthError: no depth is valid.
        """
        seen = view.valid | view.far
        w = inverse_depth(view.depth)[seen]
        near = w[w > 0]
        if not near.size:
            raise DepthError("no pixel of the picture has a depth, so there is nothing to turn about")
        pivot = 1 / float(np.median(near))
        nearest = 1 / float(np.quantile(near, 0.98))
        spread = max(float(np.median(np.abs(w - 1 / pivot))), 1e-9)
        if angle is None:
            aside = PARALLAX / 2 * view.camera.width / (view.camera.fx * spread)
            found = math.degrees(math.atan(min(aside, TOWARDS * way_to_back(view)) / pivot))
            angle = min(max(found, 1.0), 12.0)  # a flat scene would ask for ever more; beyond little was measured
        if distance is None:
            distance = min(0.5 * math.tan(math.radians(min(angle, 45.0))), 0.3 * nearest / pivot)
        return cls(view.camera, pivot, angle, distance)

    def at(self, across: float, up: float, forward: float) -> Camera:
        """The camera at a place of the box, -1..1 along each of its axes; 0, 0, 0 is the source camera."""
        turned = orbit(self.camera, across * self.angle, up * self.angle, self.pivot)
        return dolly(turned, forward * self.distance * self.pivot)

    def grid(self) -> list[Camera]:
        """The corners and the middles of edges and sides, the left and right one first: 26, or 8 of a box without depth."""
        depth = SIDES if self.distance > 0 else (0.0,)
        places = sorted(itertools.product(SIDES, SIDES, depth), key=lambda place: any(place[1:]))
        places.remove((0.0, 0.0, 0.0))
        return [self.at(*place) for place in places] if self.angle > 0 or self.distance > 0 else []

    def step_that_shows(self, camera: Camera) -> float:
        """Step in inverse depth (1/m) that moves two surfaces apart by half a pixel of a camera's picture from the middle of the
        box to its side: what moves less is drawn as one."""
        return 0.5 / max(camera.fx * self.pivot * math.tan(math.radians(self.angle)), 1e-9)

    def wide(self, forward: float = 0.0) -> Camera:
        """The camera so far forward (-1..1), with a picture so much larger that it holds what the others see at the pivot and
        beyond."""
        middle = self.at(0, 0, forward)
        width, height = self.camera.wh
        corners = np.array([[x, y, 1.0] for x in (0, width) for y in (0, height)]) @ np.linalg.inv(self.camera.K).T
        margin = np.zeros(2)
        for camera in self.grid():
            for metres in (0.5 * self.pivot, self.pivot, 100 * self.pivot):
                points = transform_points(camera.world_from_cam, metres * corners)
                pixels, _ = project(points, middle)
                outside = np.maximum(-pixels, pixels - (width, height))
                margin = np.maximum(
                    margin, np.where(np.isnan(outside), np.inf, outside).max(0)
                )  # nan: behind the camera
        x, y = (math.ceil(min(pad, int(WIDEST * side))) for pad, side in zip(margin, (width, height)))
        return middle.cropped(-x, -y, width + 2 * x, height + 2 * y)

    def sample(self, count: int, seed: int = 0) -> list[Camera]:
        """Cameras drawn evenly from the whole box."""
        return [self.at(*place) for place in np.random.default_rng(seed).uniform(-1, 1, (count, 3)).tolist()]


def way_to_back(view: View) -> float:
    """Metres to the side, up or down after which BEHIND of the surfaces of a view are seen from behind; inf: never.

    A surface element at p with the normal n is seen from behind beyond s = n p / n d in the direction d.
    """
    rows, columns = (np.linspace(0, side - 1, min(side, 96)).astype(np.intp) for side in view.camera.hw)
    depth = np.where(view.valid, view.depth, np.nan)[np.ix_(rows, columns)].astype(float)
    rays = np.stack([*np.meshgrid(columns + 0.5, rows + 0.5), np.ones(depth.shape)], 2) @ np.linalg.inv(view.camera.K).T
    points = depth[..., None] * rays
    right, down = points[:-1, 1:] - points[:-1, :-1], points[1:, :-1] - points[:-1, :-1]
    normal = np.cross(right, down)
    toward = (normal * points[:-1, :-1]).sum(2)
    known = np.isfinite(toward)
    ways = []
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis in (0, 1):
            way = (toward / normal[..., axis])[known]
            ways += [np.where(way * sign > 0, np.abs(way), np.inf) for sign in (-1, 1)]
    return min((float(np.quantile(way, BEHIND, method="lower")) for way in ways if way.size), default=math.inf)
