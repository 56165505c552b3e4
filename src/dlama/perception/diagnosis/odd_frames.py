"""Posed frames of one scene in; findings on frames of another size or depth scale, or at a wrong place, out.

Points of a frame are reprojected to its neighbours and back, and compared with the depth and colour measured there. A frame is
reported if they agree clearly better with its depth multiplied by some factor, or if it contradicts neighbours that agree.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise

import numpy as np

from dlama.errors import format_size
from dlama.geometry.camera import Float64Array
from dlama.geometry.frames.gathering import OUTLIER
from dlama.perception.diagnosis.finding import Finding, certainty
from dlama.perception.diagnosis.poses import (
    FEWEST,
    LANDS_WITHIN,
    LEAST_FIT,
    LEAST_LEAD,
    SmallFrame,
    check_poses,
    find_landing_points,
    reproject,
)


def compare_frames(frames: Mapping[str, SmallFrame], row: Sequence[str], scene: str) -> list[Finding]:
    """Findings on the poses of frames in a row (by name), without those that do not fit the others; where these fit, on those.

    row: names of which `frames` lack those that cannot be read. scene: what messages call it.
    """
    odd = find_odd_frames(list(frames.values()), list(frames))
    even = [name for name in row if not any(each.what.startswith(f"{name}:") for each in odd)]
    pairs = [(frames[one], frames[other]) for one, other in pairwise(even) if one in frames and other in frames]
    of_row = check_poses(pairs, scene)
    return of_row if any(each.severity == "fault" for each in of_row) else odd or of_row


def check_sizes(sizes: Mapping[str, tuple[int, int]], scene: str) -> list[Finding]:
    """Reports frames of a scene that are not of one size: (height, width) by name."""
    counts = Counter(sizes.values()).most_common()
    if len(counts) < 2:
        return []
    usual, count = counts[0]
    others = [f"{name} ({format_size(hw)})" for name, hw in sizes.items() if hw != usual]
    named = ", ".join(others[:3]) + (", ..." if len(others) > 3 else "")
    what = f"{scene}: {count} of {len(sizes)} frames are {format_size(usual)}, not {named}; `dlama sequence` takes one size"
    mend = "bring picture, depth and camera of all to one size, or leave the others out"
    return [Finding("frame-sizes", "fault", 1.0, what, mend)]


def find_odd_frames(frames: Sequence[SmallFrame], names: Sequence[str]) -> list[Finding]:
    """A finding for each odd frame; none where most are (the fault is elsewhere then), or where there are fewer than three."""
    if len(frames) < 3:
        return []
    found = [
        check_scale(frame, [frames[other] for other in nearest], name)
        or check_place(frame, [frames[other] for other in nearest], name)
        for frame, nearest, name in zip(frames, neighbours(frames), names)
    ]
    odd = [finding for finding in found if finding is not None]
    return odd if 2 * len(odd) < len(frames) else []


def neighbours(frames: Sequence[SmallFrame]) -> list[list[int]]:
    """For each frame the four with the nearest cameras and a similar view direction; most of them must agree."""
    middle = np.median([np.median(frame.points[:, 2]) for frame in frames if len(frame.points)] or [np.float64(1)])
    poses = np.array([frame.camera.world_from_cam for frame in frames])
    stands = poses[:, :3, 3] / middle
    looks_at = stands + poses[:, :3, 2]
    away = sum(np.linalg.norm(each[:, None] - each[None], axis=2) for each in (stands, looks_at))
    np.fill_diagonal(away, np.inf)
    return [list(np.argsort(row, kind="stable")[: min(4, len(frames) - 1)]) for row in away]


def check_scale(frame: SmallFrame, others: Sequence[SmallFrame], name: str) -> Finding | None:
    """Reports a frame that fits two or more others clearly better with its depth multiplied by some factor."""
    factor = depth_factor(frame, others)
    rescaled = frame._replace(points=frame.points * factor, depth=frame.depth * np.float32(factor))
    as_read, best = fits(frame, others), fits(rescaled, others)
    fit, lead = lower_median(best), lower_median(best / np.maximum(as_read, 0.01))
    if max(factor, 1 / factor) < 1.1 or fit < LEAST_FIT or lead < LEAST_LEAD:
        return None
    times = f"{max(factor, 1 / factor):.3g} times too {'small' if factor > 1 else 'large'}"
    shows = f"so {fit:.0%} of its points fit the neighbouring frames, {lower_median(as_read):.0%} as read"
    what, mend = f"{name}: depth is {times}; {shows}", f"multiply its depth by {factor:.3g}"
    return Finding("depth-scale", "fault", certainty(lead - 1, 0.3), what, mend)


def check_place(frame: SmallFrame, others: Sequence[SmallFrame], name: str) -> Finding | None:
    """Reports a frame that contradicts most of its neighbours, which agree with each other."""
    shares = sorted(share for share in (share_on_surfaces(frame, other) for other in others) if share is not None)
    among = [share for pair in combinations(others, 2) if (share := share_on_surfaces(*pair)) is not None]
    # of frames that agree .8 and more: recorded ones have .9, of a wrong scale .63
    if len(shares) < 2 or shares[len(shares) // 2] >= OUTLIER or not among or np.median(among) < 0.8:
        return None
    what = f"{shares[len(shares) // 2]:.0%} of what it and its neighbours can both see lies on common surfaces"
    what = f"{name}: {what}, of the neighbours' {np.median(among):.0%}: its pose, or its depth, is wrong"
    return Finding("pose", "fault", 0.9, what, "correct it, or leave the frame out")


def share_on_surfaces(one: SmallFrame, other: SmallFrame) -> float | None:
    """Share of the points of two frames that lie on the other's surface, of those that do or that the other sees through; None:
    there are few."""
    agree, through = 0, 0
    for z, depth, *_ in (reproject(one, other), reproject(other, one)):
        agree += int((np.abs(depth - z) < LANDS_WITHIN * z).sum())
        through += int((depth - z >= LANDS_WITHIN * z).sum())
    return agree / (agree + through) if agree + through >= FEWEST else None


def fits(frame: SmallFrame, others: Sequence[SmallFrame]) -> Float64Array:
    """Agreement of the frame with each of the others."""
    return np.array(
        [(find_landing_points(frame, other).fit + find_landing_points(other, frame).fit) / 2 for other in others]
    )


def lower_median(values: Float64Array) -> float:
    """The lower median: reached by more than half of the neighbours."""
    return float(np.sort(values)[(len(values) - 1) // 2])


def depth_factor(frame: SmallFrame, others: Sequence[SmallFrame]) -> float:
    """The factor for the frame's depth, from the reprojection of the others' points, which does not depend on its depth."""
    ratios = []
    for other in others:
        z, depth, _, _ = reproject(other, frame)
        if len(z) >= FEWEST:
            ratios.append(np.median(np.log(z / depth)))
    return float(np.exp(np.clip(np.median(ratios), -20, 20))) if ratios else 1.0
