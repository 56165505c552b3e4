"""A picture with depth, or a scene, in; the scene completed for all cameras of a head box out: it turns without holes."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from dlama.arguments import check_arguments
from dlama.completion.memory import check_memory
from dlama.completion.meta_data import MetaData, read_only
from dlama.completion.options import Options
from dlama.completion.report import Clock, meta_data, warn_of_scale
from dlama.completion.start import Plan, describe_depth, plan_for, scene_of
from dlama.completion.steps import CompletedView, complete_frame, complete_view, frames_to_fill
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.drawing.layers import Surface, rasterize_surface
from dlama.geometry.frames.choosing import choose_frames
from dlama.geometry.frames.stored import Layer
from dlama.geometry.fusion import add_layer
from dlama.geometry.holes import box_around, larger_box, morphological_open, square
from dlama.geometry.layers.edge_layers import continue_under_edges
from dlama.geometry.layers.head_box import HeadBox
from dlama.geometry.layers.soft_edges import separate_colors
from dlama.geometry.layers.subsampling import step_for, subsample_camera, subsample_scene
from dlama.geometry.projection import px_from_px
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene
from dlama.inpainters import AUTO
from dlama.inpainters.filling import Inpainter
from dlama.progress import Progress, begin_stage, take_progress

HIDDEN_PIXELS = 500_000
"""Of a larger picture what is hidden is filled at a whole fraction of its size that has at most so many pixels."""
LOOK_PIXELS = 100_000
"""What is still unknown is looked for in pictures of a whole fraction of their size that have at most so many pixels."""
CLOSED = 3
"""px of the smallest square that counts as unknown: what is narrower rendering closes."""
AROUND = 48
"""px round what is unknown that a camera is cut to: what the filler continues."""
OVERLAP = 4
"""px by which fills reach over what was known: renderers of triangles close no gaps."""
UNDER_EDGES = 0.025
"""Share of the width by which surfaces continue under depth edges, where nothing else was filled."""
BETWEEN = 6
"""Cameras within the box whose views must be known, besides those of the grid on its surface."""
WIDE_CAMERAS = 2
"""The source camera and the one at the back of the box, with larger pictures: what lies out of view is filled in theirs."""
ENOUGH, MOST_CAMERAS = 1e-3, 14
"""Share of any view of the grid that may stay open; cameras that are filled at most."""


@dataclass(frozen=True, eq=False)
class Photo3D:
    """A scene that can be looked at from every camera of its box."""

    scene: Scene
    """The source as it was given, and behind it what was filled."""
    box: HeadBox
    """Where it may be looked at from."""
    meta: MetaData
    """As of a completion, and `photo3d`."""

    def __post_init__(self) -> None:
        vars(self)["meta"] = read_only(self.meta)

    def __repr__(self) -> str:
        width, height = self.box.camera.wh
        reach = f"{self.box.angle:.3g} degrees and {self.box.distance:.0%} of {self.box.pivot:.3g} m"
        return f"Photo3D({width}x{height}, to be looked at within {reach}, {len(self.scene.fills)} fills)"


@take_progress
def photo3d(
    rgbd: RGBD | Scene,
    *,
    angle: float | None = None,
    distance: float | None = None,
    filler: str | Inpainter = AUTO,
    model: str | Path | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Photo3D:
    """Complete a scene for all cameras of a head box round the source camera, each hole once.

    A larger picture from the source camera is filled first, one from the back of the box, its left and right end, and then
    always the camera that sees most that is still unknown. Of a picture of more than HIDDEN_PIXELS what is hidden is filled at
    a fraction of its size; what was measured stays as it is.

    Args:
        rgbd: A picture with metric depth; or a scene: of a completion (an object may have been removed), of `scene` or
            `read_scene`; of several frames the middle one is the source.
        angle: Degrees to which the camera may turn about the pivot (the median depth), to each side, up and down; None: so that
            the median parallax from end to end is 4 % of the picture's width.
        distance: How far it may go forward and back, as a share of the pivot's distance; None: half of its way to the side.
        filler, model, seed, progress: As in `complete`.
    Raises:
        InputError: an unknown name, an angle or a distance that is none; DepthError: nothing has a depth.
    """
    check_arguments(photo3d, locals())
    start = scene_of(rgbd)
    check_memory([one.camera for one in start.frames])
    source = start.middle_frame.load()
    warn_of_scale(source.depth)
    step = step_for(int((~source.hole).sum()), HIDDEN_PIXELS)
    clock = Clock()
    with clock("prepare"):
        options = Options(filler=filler, model=model, seed=seed)
        begun = plan_for(subsample_scene(start, step), options)
        plan, small = begun.plan, begun.scene
        given = len(small.fills)
        box = HeadBox.of(source, angle, distance)
        grid_box = dataclasses.replace(box, camera=small.middle_frame.camera)
        steps: list[CompletedView] = []
    for place in frames_to_fill(plan, small, [grid_box.camera]):
        found, small = complete_frame(plan, small, place, clock)
        steps.append(found)
    with clock("edges"):
        small = dataclasses.replace(small, frames=tuple(separate_colors(frame.load()) for frame in small.frames))
    small, seen, open_share = complete_box(plan, small, grid_box, clock)
    steps += seen
    with clock("edges"):
        small = add_edge_layers(small, grid_box)
    scene = add_fills(start, small, small.fills[given:], step)
    reports, warped = [report for one in steps for report in one.reports], [one.before for one in steps]
    grown = [one.grown for one in steps]
    meta = describe_depth(rgbd) | meta_data(plan, source, warped, reports, clock.seconds, holes=grown)
    about = {
        "pivot_m": round(box.pivot, 5),
        "angle_deg": round(box.angle, 4),
        "distance": round(box.distance, 5),
        "filled_cameras": [one.view.camera.world_from_cam.tolist() for one in seen],
        "hidden_step": step,
        "open_share": round(open_share, 6),
    }
    return Photo3D(scene, box, meta | {"photo3d": about})


def complete_box(plan: Plan, scene: Scene, box: HeadBox, clock: Clock) -> tuple[Scene, list[CompletedView], float]:
    """The scene completed for the cameras of a box, in whose frames everything has a depth; the views that were filled for it,
    and the share that stays open of the view that has most of it."""
    with clock("look"):
        unknown = Unknown(scene, box)
    seen: list[CompletedView] = []
    while unknown.share > ENOUGH and len(seen) < MOST_CAMERAS:
        wide = len(seen) < WIDE_CAMERAS
        camera = box.wide(-len(seen)) if wide else unknown.next_camera()
        found, larger = complete_view(plan, scene, camera, clock)
        before = len(scene.fills)
        seen.append(found)
        with clock("look"):
            for layer in larger.fills[before:]:
                why = layer.load().hole_type
                # of what objects hide, a wide camera sees slivers; the others see more of it
                added = why == HoleType.OUT_OF_VIEW.value if wide else why != HoleType.NONE.value
                scene = add_layer(scene, found.view, added, OVERLAP)
            unknown.look(scene.fills[before:])
        begin_stage(f"filled for camera {len(seen)}, {unknown.share:.2%} still unknown")
    return scene, seen, unknown.share


class Unknown:
    """What is still unknown of a scene, in whose frames everything has a depth, from cameras of a box, looked at in pictures of
    every `step`-th pixel."""

    def __init__(self, scene: Scene, box: HeadBox) -> None:
        self.step = step = step_for(int((~scene.middle_frame.load().hole).sum()), LOOK_PIXELS)
        self.cameras = box.grid()
        if self.cameras:
            self.cameras += box.sample(BETWEEN, seed=1)
        self.next_ones = list(range(min(2, len(self.cameras))))
        self.small = [
            subsample_camera(camera, step, (camera.height // step, camera.width // step)) for camera in self.cameras
        ]
        self.holes = [np.ones(camera.hw, bool) for camera in self.small]
        frames = tuple(scene.frames[place] for place in choose_frames(scene.frames, box.camera))
        self.look((*frames, *scene.fills))

    @property
    def share(self) -> float:
        """Of the view that has most of it, 0..1."""
        return max((float(hole.mean()) for hole in self.holes), default=0.0)

    def next_camera(self) -> Camera:
        """The left and the right end of the box, and then the camera that sees most of it, cut to what is round it."""
        counts = [int(hole.sum()) for hole in self.holes]
        self.next_ones = [number for number in self.next_ones if counts[number]]
        number = self.next_ones.pop(0) if self.next_ones else int(np.argmax(counts))
        camera = self.cameras[number]
        box = [slice(side.start * self.step, side.stop * self.step) for side in box_around(self.holes[number], 0)]
        return camera.cropped_to(*larger_box((box[0], box[1]), AROUND, camera.hw))

    def look(self, layers: tuple[Layer, ...]) -> None:
        """Take off what the layers show."""
        for layer in layers:
            view = layer.load()
            view = view.cropped(*box_around(~view.hole, 2))
            surface = Surface(view)
            depth, joined, far = surface.seen
            for hole, camera in zip(self.holes, self.small):
                if hole.any():
                    box = box_around(hole, 0)
                    part = camera.cropped_to(*box)
                    shown = rasterize_surface(depth, joined, surface.rim, view.camera, part).w > 0
                    hole[box] &= ~(shown | find_far(far, view.camera, part))
        side = square(max(2, -(-CLOSED // self.step)))
        self.holes = [morphological_open(hole, side) for hole in self.holes]


def find_far(far: BoolArray, source: Camera, camera: Camera) -> BoolArray:
    """H x W: where a camera's picture may show far pixels of a source's."""
    if not far.any():
        return np.zeros(camera.hw, bool)
    half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])  # OpenCV's first pixel has its centre at 0
    matrix = np.linalg.inv(half) @ px_from_px(source, camera)[0] @ half
    flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    return cv2.warpPerspective(far.view(np.uint8), matrix, camera.wh, flags=flags) > 0


def add_edge_layers(scene: Scene, box: HeadBox) -> Scene:
    """The scene with what it shows of the source camera, and of the one that sees most, continued under its depth edges."""
    for camera in (box.camera, box.wide()):
        seen, reach = render(scene, camera, types=False), max(2, round(UNDER_EDGES * camera.width))
        scene = add_layer(scene, *continue_under_edges(seen, reach, box.step_that_shows(camera)))
    return scene


def add_fills(start: Scene, small: Scene, fills: tuple[Layer, ...], step: int) -> Scene:
    """The scene as given with what was filled in the smaller one; sensor holes get the depth of the smaller frame's pixel."""
    frames: list[Layer] = []
    for frame, smaller in zip(start.frames, small.frames):
        view, other = frame.load(), smaller.load()
        hole = view.depth_hole
        if hole.any():
            rows, columns = (
                np.minimum(np.arange(side) // step, least - 1) for side, least in zip(frame.camera.hw, other.camera.hw)
            )
            nearest = np.ix_(rows, columns)
            filled = hole & ~other.hole[nearest]
            frame = view.with_planes(
                depth=np.where(filled, other.depth[nearest], view.depth),
                hole=view.hole & ~filled,
                origin=np.where(filled, np.uint8(Origin.DEPTH_FILLED), view.origin),
                confidence=np.where(filled, other.confidence[nearest], view.confidence),
            )
        frames.append(frame)
    return dataclasses.replace(start, frames=tuple(frames), fills=(*start.fills, *fills))
