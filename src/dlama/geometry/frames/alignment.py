"""Posed RGB-D frames of one scene in; the same with mutually consistent poses out (bundle adjustment of poses alone).

SIFT features of two frames (Lowe 2004) are matched near the positions that the given poses predict. Points keep the depth that
their frame measured; poses move so that points fall on the pixels, and the depths, of the other frames.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, TypeVar

import cv2
import numpy as np

from dlama.arguments import check_arguments
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.frames.gathering import read_frame
from dlama.geometry.frames.pose_system import Matches, adjust_poses, measure_offset
from dlama.geometry.holes import smaller_size, square
from dlama.geometry.projection import project, unproject
from dlama.geometry.rgbd import RGBD, Float32Array
from dlama.progress import Progress, begin_stage, take_progress

Source = TypeVar("Source", RGBD, Callable[[], RGBD])
REACH = 0.032
"""Search radius round the predicted position, over the picture's width."""
STEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
"""Distances in the sequence between two frames that are compared."""
ENOUGH = 12
"""Least number of matches of a pair of frames."""
FITS_PX, BETTER = 1.0, 0.75
"""Offset in px at which poses are kept as they are (median of pairs), and the factor by which others must improve."""


@dataclass(frozen=True, eq=False)
class Features:
    """Of one frame; at the size at which they were found."""

    camera: Camera
    pixels: Float64Array
    """N x 2."""
    descriptors: Float32Array
    """N x 128, square roots of shares (RootSIFT: Arandjelovic and Zisserman 2012), so that a scalar product is a similarity."""
    depth: Float64Array
    """N metres; 0 = none, or at a depth edge."""


NO_FEATURES = Features(Camera.from_fov(2, 2, 60), np.zeros((0, 2)), np.zeros((0, 128), np.float32), np.zeros(0))
"""Of a frame that cannot be read, or is of one colour."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """Result of the alignment."""

    poses: tuple[Float64Array, ...] | None
    """world_from_cam of each frame; None: the given ones stay."""
    before_px: float
    """Offset of matched points under the given poses: the median of the pairs' medians. NaN: no match."""
    after_px: float
    """The same under the new poses."""

    @property
    def decision(self) -> dict[str, dict[str, Any]]:
        """For meta.json: whose poses count, and why."""
        if np.isnan(self.before_px):
            return {"poses": {"name": "given", "reason": "frames have too few features in common to check them"}}
        name, reason = "given", "they fit the pictures"
        if self.poses is not None:
            name, reason = "aligned", f"matched features lie {self.before_px:.1f} px apart under the given ones"
        elif self.before_px > FITS_PX:
            reason = "none were found that fit the pictures better"
        offsets = {"before_px": round(self.before_px, 2), "after_px": round(self.after_px, 2)}
        return {"poses": {"name": name, "reason": reason, **offsets}}


@take_progress
def align_frames(frames: Sequence[Source], *, progress: Progress | None = None) -> list[Source]:
    """The frames with poses that agree with their pictures; the same frames where they fit already, or show no features.

    Poses of hand-held sequences are off by centimetres, and a picture's time is not its depth's: an object then lies several
    pixels apart in two frames. Poses move by as little as it takes (given ones count as known to 2 cm and half a degree);
    pixels and depths stay as they are, and so does the world on average.

    Args:
        frames: Posed frames of one scene, or functions that read them, in the order in which they were taken. Each is read once
            here, in sequences of more than 64 some twice.
        progress: Called with the name of each stage as it begins; what it raises ends the work.
    """
    check_arguments(align_frames, locals())
    found = estimate_poses(len(frames), lambda place: detect_features(read_frame(frames[place], f"frame {place}")))
    if found.poses is None:
        return list(frames)
    return [with_pose(frame, pose) for frame, pose in zip(frames, found.poses)]


def estimate_poses(count: int, features: Callable[[int], Features]) -> Alignment:
    """Poses under which the features of frames agree; the given ones where they fit, or nothing better is found.

    features: place of a frame, 0 to count - 1 -> its features. Few are held at a time.
    """

    def read(place: int) -> Features:
        begin_stage(f"find features of frame {place + 1} of {count}")
        return features(place)

    recent = lru_cache(2 * STEPS[-1])(read)
    before = check_poses(count, recent)
    if before <= FITS_PX:
        return Alignment(None, before, before)
    cameras, matches = match_all(map(recent, range(count)))
    if matches is None:
        return Alignment(None, np.nan, np.nan)
    before = measure_offset(matches, cameras)
    if before <= FITS_PX:
        return Alignment(None, before, before)
    poses = adjust_poses(matches, cameras)
    after = measure_offset(matches, [camera.at(pose) for camera, pose in zip(cameras, poses)])
    return Alignment(tuple(poses), before, after) if after <= BETTER * before else Alignment(None, before, before)


def check_poses(count: int, features: Callable[[int], Features]) -> float:
    """Offset in px of matched points of a few pairs of frames, as `Alignment.before_px`; NaN without matches."""
    offsets = []
    for i in range(0, count, max(1, -(-count // 6))):
        for j in (i + step for step in (1, 4, 12) if i + step < count):
            one, other = features(i), features(j)
            here, there = match_features(one, other)
            if len(here) >= ENOUGH:
                offsets.append(
                    np.median(np.linalg.norm(project_features(one, other)[here] - other.pixels[there], axis=1))
                )
    return float(np.median(offsets)) if offsets else np.nan


def with_pose(frame: Source, pose: Float64Array) -> Source:
    """The frame with another pose (world_from_cam)."""
    if not isinstance(frame, RGBD):
        return partial(read_with_pose, frame, pose)
    return dataclasses.replace(frame, camera=frame.camera.at(pose))


def read_with_pose(read: Callable[[], RGBD], pose: Float64Array) -> RGBD:
    """The frame that `read` gives, with another pose."""
    return with_pose(read(), pose)


def detect_features(frame: RGBD) -> Features:
    """The 900 strongest features of a frame, with its depth there."""
    camera, grey = frame.camera, cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY)
    if max(camera.wh) > 640:
        camera = camera.resized(*smaller_size(camera.hw, 640))
        grey = cv2.resize(grey, camera.wh, interpolation=cv2.INTER_AREA)
    points, descriptors = cv2.SIFT.create(900, contrastThreshold=0.02).detectAndCompute(grey, None)
    if descriptors is None:
        return Features(camera, np.zeros((0, 2)), np.zeros((0, 128), np.float32), np.zeros(0))
    pixels = np.array([point.pt for point in points], np.float64) + 0.5
    shares = descriptors / np.maximum(descriptors.sum(1, keepdims=True), 1e-6)
    depth = np.where(frame.valid, frame.depth, np.float32(0))
    nearest, farthest = cv2.erode(depth, square(5)), cv2.dilate(depth, square(5))
    x, y = np.clip(pixels * frame.camera.wh / camera.wh, 0, np.array(frame.camera.wh) - 1).astype(np.intp).T
    smooth = (nearest[y, x] > 0) & (farthest[y, x] < 1.03 * nearest[y, x])  # one surface
    surface = np.where(smooth, depth[y, x], 0).astype(np.float64)
    return Features(camera, pixels, np.sqrt(shares).astype(np.float32), surface)


def match_all(found: Iterable[Features]) -> tuple[list[Camera], Matches | None]:
    """The cameras of frames in order, and the matches of all their pairs, both ways; None where there are none."""
    cameras, parts, recent = list[Camera](), list[Matches](), deque[Features](maxlen=STEPS[-1])
    for j, new in enumerate(found):
        for i, old in ((j - step, recent[-step]) for step in STEPS if step <= len(recent)):
            here, there = match_features(old, new)
            if len(here) >= ENOUGH:
                parts.append(match_pair(i, j, old, new, here, there))
                back = new.depth[there] > 0
                if back.sum() >= ENOUGH:
                    parts.append(match_pair(j, i, new, old, there[back], here[back]))
        cameras.append(new.camera)
        recent.append(new)
    return cameras, Matches.concatenate(parts) if parts else None


def match_pair(i: int, j: int, one: Features, other: Features, here: np.ndarray, there: np.ndarray) -> Matches:
    """The matches of a pair: features `here` of one frame and `there` of the other, by number."""
    x, y = one.pixels[here].T
    points = unproject(one.camera.at(np.eye(4)), x, y, one.depth[here])
    places = np.full(len(here), i), np.full(len(here), j)
    return Matches(*places, points, other.pixels[there], other.depth[there], np.zeros(1, np.intp))


def match_features(one: Features, other: Features) -> tuple[np.ndarray, np.ndarray]:
    """Indices of matched features of two frames: `one` has their depth, `other` shows them at the predicted place. Both are the
    other's best; squared distances of descriptors lie in 0..2."""
    nothing = np.zeros(0, np.intp), np.zeros(0, np.intp)
    at = project_features(one, other)
    ahead = np.flatnonzero(np.isfinite(at[:, 0]))
    if not len(ahead) or not len(other.pixels):
        return nothing
    distance = 2 - 2 * one.descriptors[ahead] @ other.descriptors.T
    distance[squared_distances(at[ahead], other.pixels) > (REACH * other.camera.width) ** 2] = np.inf
    best, back = distance.argmin(1), distance.argmin(0)
    number = np.arange(len(ahead))
    closest = distance[number, best]
    good = (closest < 0.25) & (back[best] == number)
    one_place = squared_distances(other.pixels[best[good]], other.pixels) < 4  # a place has several orientations
    second = np.where(one_place, np.inf, distance[good]).min(1)
    good[good] = closest[good] < 0.64 * second
    return ahead[good], best[good]


def squared_distances(points: Float64Array, others: Float64Array) -> Float32Array:
    """N x M squared distances between points N x 2 and M x 2."""
    across, down = ((points[:, k, None] - others[None, :, k]).astype(np.float32) for k in (0, 1))
    return across * across + down * down


def project_features(one: Features, other: Features) -> Float64Array:
    """N x 2 predicted pixels of one's features in the other frame; NaN without depth, or far out of view."""
    to, reach = other.camera, REACH * other.camera.width
    at, z = project(unproject(one.camera, one.pixels[:, 0], one.pixels[:, 1], one.depth), to)
    seen = (one.depth > 0) & (z > 0.05) & (at > -reach).all(1) & (at < np.array(to.wh) + reach).all(1)
    return np.where(seen[:, None], at, np.nan)
