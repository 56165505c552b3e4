"""What a filler knows besides its view: the visibility law of the scene and the colour of its sky."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from dlama.arguments import check_arguments
from dlama.geometry.camera import Camera
from dlama.geometry.codes import from_source
from dlama.geometry.depth_noise import noise_to_average
from dlama.geometry.frames.choosing import MOST_FRAMES, choose_frames
from dlama.geometry.frames.stored import BLOCK, coarse_depth
from dlama.geometry.rgbd import Float32Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.geometry.visibility import Law, subtract_noise
from dlama.inpainters.confidence import depth_noise

HELD_BYTES = 256_000_000
"""Most memory for the depth of all frames; beyond it, depth is computed for each camera."""


@dataclass(frozen=True, eq=False)
class FillContext:
    """The depth constraints and the sky of the scene that a view shows."""

    law: Law
    """The visibility law; without measurements where `scene` is set."""
    sky: Float32Array | None = field(default=None, repr=False)
    """3, the mean RGB (0..255) of the measured far pixels, for views that show none of them; None: there were none."""
    noise: float = 0.0
    """Of the depth of the first frame, where it is drawn without (`grid_mesh.smooth_noise`), as confidence counts it; else 0."""
    scene: Scene | None = None
    """The scene, for too many frames to hold their depth; `near` then gives the context for a camera."""

    @classmethod
    def of(cls, scene: Scene) -> FillContext:
        """The context of a scene, for all cameras."""
        check_arguments(cls.of, locals())
        if len(scene.frames) > 1 and sum(4 * one.camera.width * one.camera.height for one in scene.frames) > HELD_BYTES:
            return cls(Law(()), scene=scene)
        return cls(Law.of(scene), sky_of(scene), noise_of(scene))

    def near(self, camera: Camera) -> FillContext:
        """The context for a camera: itself; of very many frames, that of the frames drawn for it, and of 24 more their coarse
        depth, the nearest of blocks of pixels."""
        if self.scene is None:
            return self
        whole = self.scene
        places = choose_frames(whole.frames, camera, MOST_FRAMES + 24)
        frames = [whole.frames[place] for place in places[:MOST_FRAMES]]
        removed = [one for one in whole.removals if any(one.camera.same_view_as(each.camera) for each in frames)]
        drawn = Scene(tuple(frames), tuple(removed), noise=whole.noise)
        coarse = [
            (
                each.camera.with_larger_pixels(BLOCK, math.ceil),
                subtract_noise(each.find_once(coarse_depth), whole.noise),
            )
            for each in (whole.frames[place] for place in places[MOST_FRAMES:])
        ]
        return FillContext(Law((*Law.of(drawn).measured, *coarse)), sky_of(drawn), noise_of(drawn))

    def cropped(self, view: View, rows: slice, columns: slice) -> FillContext:
        """The context for a part of a view (`View.cropped`)."""
        return replace(self, law=self.law.cropped(view, rows, columns))


def noise_of(scene: Scene) -> float:
    """As of `FillContext`."""
    frame = scene.frames[0].load()
    return frame.find_once(depth_noise) if frame.find_once(noise_to_average).constant else 0.0


def sky_of(scene: Scene) -> Float32Array | None:
    """3, the mean RGB of a scene's measured far pixels; None: there are none."""
    sums, count = np.zeros(3), 0
    for layer in (layer.load() for layer in scene.layers if layer.has_far):
        far = layer.far & from_source(layer.origin)
        pixels = int(far.sum())
        sums += pixels * np.array(cv2.mean(layer.color, far.view(np.uint8))[:3])
        count += pixels
    return (sums / count).astype(np.float32) if count else None
