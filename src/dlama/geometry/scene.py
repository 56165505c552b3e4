"""Scene: frames, removed objects and fills; renders and lifts as one."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np

from dlama.arguments import check
from dlama.errors import InputError, ShapeError, check_same_size, format_count
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.cloud import concatenate
from dlama.geometry.codes import HoleType, Origin, from_filler
from dlama.geometry.figures.points import point_viewer
from dlama.geometry.frames.stored import Layer
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.view import View


@dataclass(frozen=True, eq=False)
class Scene:
    """Frames, removed objects and fills of a scene.

    One picture is a scene of one frame. Several frames are of equal rank: they are merged pixel by pixel. Holes of a view
    contribute nothing. Of two fills on one surface the earlier one wins, and frames win over both. `scene.frames[0].load()` is
    the View of a frame: of many frames those that are not in use are not in memory.
    """

    frames: tuple[Layer, ...]
    """Pictures of the scene without removed objects; at least one, of one size. Sensor holes may have filled depth."""
    removals: tuple[Layer, ...] = ()
    """Removed objects: views of frames in which all but the object is a hole. In c+ (eq. 10), not in c- (eq. 11)."""
    fills: tuple[Layer, ...] = ()
    """Fills in their order, and what only the right camera of a stereo pair measured. As bright as their camera's frame."""
    numbers: tuple[int, ...] = ()
    """Numbers of the frames as given; 0, 1, 2 ... by default."""
    gains: tuple[tuple[float, float, float], ...] = ()
    """Gains of each frame's channels to the scene's common brightness; 1 by default."""
    noise: tuple[float, float] = (0.0, 0.0)
    """Standard deviation of the frames' depth z, poses included: hypot(noise[0], noise[1] z^2) metres."""
    names: tuple[str, ...] = ()
    """Names of the frames; by default those of their numbers, frame-0000, frame-0001 ..."""

    def __post_init__(self) -> None:
        for name in ("frames", "removals", "fills"):
            check(getattr(self, name), Iterable[Layer], name)
            object.__setattr__(self, name, tuple(getattr(self, name)))
            check(getattr(self, name), tuple[Layer, ...], name)
        check(self.numbers, Sequence[int], "numbers")
        check(self.gains, Sequence[Any], "gains")
        check(self.names, Sequence[str], "names")
        count = len(self.frames)
        if not count:
            raise ShapeError("`frames` is empty; a scene of one frame or more is expected")
        numbers = tuple(self.numbers) or range(count)
        for name, default in (
            ("numbers", numbers), ("gains", [(1.0, 1.0, 1.0)] * count), ("names", map(name_of_number, numbers))
        ):  # fmt: skip
            object.__setattr__(self, name, tuple(getattr(self, name)) or tuple(default))
            if len(getattr(self, name)) != count:
                raise ShapeError(
                    f"{name} has {len(getattr(self, name))} entries for {format_count(count, 'frame')}; as many are expected"
                )
        for frame, name in zip(self.frames, self.names):
            check_same_size(name, frame.camera.hw, self.names[0], self.frames[0].camera.hw)

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The frames, then the fills: all visible layers."""
        return (*self.frames, *self.fills)

    @property
    def middle_frame(self) -> Layer:
        """The frame in the middle, from which cameras move."""
        return self.frames[len(self.frames) // 2]

    @property
    def middle_number(self) -> int:
        """The number of that frame."""
        return self.numbers[len(self.numbers) // 2]

    @property
    def has_estimated_depth(self) -> bool:
        """True if a network estimated the depth of a frame."""
        return any(Origin.ESTIMATED in frame.origins for frame in self.frames)

    def gain_of(self, camera: Camera) -> Float64Array:
        """3, gains to the scene's common brightness of what this camera took, or of what was filled in its view."""
        found = (gain for gain, frame in zip(self.gains, self.frames) if camera.same_view_as(frame.camera))
        return np.array(next(found, (1.0, 1.0, 1.0)))

    def has_frame_of(self, camera: Camera) -> bool:
        """Whether a frame was taken by this camera."""
        return any(camera.same_view_as(frame.camera) for frame in self.frames)

    @cached_property
    def unfilled(self) -> Scene:
        """The scene as measured, without removed objects and without any fill, also of sensor holes."""
        frames = tuple(frame.without_filled_depth() for frame in self.frames)
        fills = tuple(fill for fill in self.fills if fill.shows_source)
        same = (frames, fills) == (self.frames, self.fills)
        return self if same else dataclasses.replace(self, frames=frames, fills=fills)

    def original(self, place: int) -> Layer:
        """One of the layers, a frame or a fill, with its removed objects put back."""
        layer = self.layers[place]
        for removed in self.removals:
            if removed.camera.same_view_as(layer.camera):
                part = removed.load()
                layer = layer.load().with_pixels(part, part.origin != Origin.UNKNOWN.value)
        return layer

    def without(self, mask: BoolArray | Mapping[int, BoolArray], dilate: int | None = None) -> Scene:
        """The scene without the object under a mask. Earlier fills are dropped: they were made with the object in sight.

        Args:
            mask: H x W bool, True = remove, of a scene of one frame; or number of a frame -> its mask, for one frame or several.
                The other frames' masks follow from the object's shape.
            dilate: px by which the mask grows; None: 3, in proportion more where the longer side exceeds 1024 px.
        Raises:
            MaskError: an empty or full mask, or one of another size; InputError: a frame that is not in the scene.
        """
        # it renders scenes and looks at pictures: imported late
        remove_object = import_module("dlama.perception.object_removal").remove_object
        found: Scene = remove_object(self, mask, dilate).scene
        return found

    def with_frame(self, frame: RGBD | Callable[[], RGBD]) -> Scene:
        """The scene with one more posed frame, of the next number; a faulty frame is left out with a warning.

        Its measurements replace fills. Removed objects are removed from it, too.

        Args:
            frame: A picture with metric depth, of the size of the others, its camera in the scene's world; or a function that
            reads it.
        Raises:
            InputError: no depth, another size (ShapeError), or two frames without common surfaces.
        """
        add_frame = import_module("dlama.geometry.frames.gathering").add_frame
        find_removed = import_module("dlama.perception.object_removal").find_removed
        found: Scene = add_frame(self, frame, find_removed)
        return found

    def place_of(self, number: int) -> int:
        """Index in `frames` of the frame of that number. InputError: there is none."""
        if number in self.numbers:
            return self.numbers.index(number)
        first, last = self.numbers[0], self.numbers[-1]
        known = f"{first} to {last}" if len(self.numbers) > 8 else ", ".join(map(str, self.numbers))
        raise InputError(f"`mask` is for frame {number!r}, which is not in the scene; it has frames {known}")

    def __repr__(self) -> str:
        parts = (
            format_count(len(self.frames), "frame"),
            format_count(len(self.removals), "removal"),
            format_count(len(self.fills), "fill"),
        )
        return f"Scene({', '.join(parts)}, first frame {self.frames[0].load()!r})"

    def _repr_png_(self) -> bytes:
        return self.frames[0].load()._repr_png_()

    def _repr_html_(self) -> str:
        cloud = concatenate([lift(layer.load()) for layer in self.layers])
        return point_viewer(repr(self), cloud, self.frames[0].camera.cam_from_world)


def name_of_number(number: int) -> str:
    """The name of a frame that was given none."""
    return f"frame-{number:04d}"


def replace_frame(scene: Scene, place: int, frame: View) -> Scene:
    """The scene with another frame in that place."""
    return dataclasses.replace(scene, frames=(*scene.frames[:place], frame, *scene.frames[place + 1 :]))


def contribution(view: View) -> BoolArray:
    """H x W, True at the pixels a layer adds to the scene's cloud: measured or filled here, not seen again.

    What was measured and is seen again has the origin REPROJECTED; what was filled before and is, no hole type.
    """
    filled_before = from_filler(view.origin) & (view.hole_type == HoleType.NONE.value)
    return view.valid & (view.origin != Origin.REPROJECTED.value) & ~filled_before
