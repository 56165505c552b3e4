"""Two pictures and, where known, a disparity or a matcher in; the pair with the disparity of both, and what found it, out."""

from __future__ import annotations

import functools
from collections.abc import Sized
from pathlib import Path
from typing import Any

import numpy as np

from dlama.arguments import as_array, function_name
from dlama.completion.stereo.pair import MatchedPair, default_far, depth_in_metres
from dlama.errors import InputError, ShapeError, check_same_size, warn
from dlama.geometry.camera import StereoRig
from dlama.geometry.projection import known_disparity
from dlama.geometry.rgbd import Float32Array, UInt8Array, mark_far
from dlama.perception.diagnosis.stereo_pair import find_many_unmatched, find_pair_fault, refuse_identical
from dlama.perception.monocular import LEAST_CONTRAST, contrast
from dlama.perception.sky import drop_plain_infinity
from dlama.perception.stereo.consistency import transfer_disparity
from dlama.perception.stereo.matching import Matcher, disparity_pair
from dlama.perception.stereo.networks import NetworkMatcher


def match_pair(
    colors: tuple[UInt8Array, UInt8Array],
    rig: StereoRig,
    far: float | None,
    *,
    disparity: Float32Array | None,
    matcher: str | Path | Matcher | None,
    max_disparity: float | None,
) -> MatchedPair:
    """The pair (pictures H x W x 3) with the given left disparity (H x W px; 0, NaN, inf = unknown) and what it says of the right
    view, or with what a network file, a function or semi-global matching finds. What speaks against a rectified pair is warned
    of. far: in metres.

    Raises InputError: options that contradict each other, identical pictures; ShapeError: a disparity of another size;
    DepthError: nothing is nearer than `far`; what the matcher raises.
    """
    left, right = colors
    given = {"disparity": disparity, "matcher": matcher, "max_disparity": max_disparity}
    named = [name for name, value in given.items() if value is not None]
    if len(named) > 1:
        raise InputError(f"`{named[0]}` and `{named[1]}` contradict each other; give one of them")
    match, notes = matcher_for(matcher, max_disparity, rig)
    refuse_identical(left, right)
    if disparity is None:
        for name, picture in (("left", left), ("right", right)):
            if contrast(picture) < LEAST_CONTRAST:
                raise InputError(
                    f"the {name} picture has nearly one colour all over: there is nothing to match; give `disparity`"
                )
        found = match(left, right)
        notes = {**notes, "unmatched_share": float((found[0] == 0).mean())}
    else:
        given_left = check_disparity(disparity, rig, "`disparity`")
        if not given_left.any():
            raise InputError(
                "disparity has no known pixel in front of the cameras; the left x minus the right x of a point is expected"
            )
        found, notes = (given_left, transfer_disparity(given_left)), {"matcher": "none: the disparity was given"}
    doubt = find_pair_fault(left, right, found[0], rig.doffs)
    if disparity is None:
        doubt = doubt or find_many_unmatched(left, depth_in_metres(found[0], rig, np.inf))
    if doubt is not None:
        warn(doubt)
        notes = {**notes, "doubt": doubt}
    if far is None:
        far = default_far(rig)
    else:
        mark_far(depth_in_metres(found[0], rig, np.inf), far)
    return MatchedPair(rig, far, colors, found, None, match, notes)


def matcher_for(
    matcher: str | Path | Matcher | None, max_disparity: float | None, rig: StereoRig
) -> tuple[Matcher, dict[str, Any]]:
    """The matcher, and its notes."""
    if callable(matcher):
        return functools.partial(run_matcher, matcher, rig), {"matcher": function_name(matcher)}
    if matcher is not None:
        network = NetworkMatcher.open(matcher)
        return network, {"matcher": network.file.notes}

    lowest = min(max(-rig.doffs, -rig.left.width / 2), 0.0)  # px, of a point at infinity

    def match(left: UInt8Array, right: UInt8Array) -> tuple[Float32Array, Float32Array]:
        found = disparity_pair(left, right, max_disparity=max_disparity, min_disparity=lowest)
        at_left, at_right = (
            drop_plain_infinity(color, one, depth_in_metres(one, rig, default_far(rig)))
            for color, one in zip((left, right), found)
        )
        return at_left, at_right

    return match, {"matcher": "semi-global matching", "max_disparity": max_disparity}


def run_matcher(
    matcher: Matcher, rig: StereoRig, left: UInt8Array, right: UInt8Array
) -> tuple[Float32Array, Float32Array]:
    """What a user's matcher finds in two pictures (H x W x 3), as `check_disparity` gives it. InputError: no two disparities."""
    found = matcher(left, right)
    if not isinstance(found, (tuple, list, np.ndarray)) or len(found) != 2:
        came = f"a {type(found).__name__}" + (f" of {len(found)}" if isinstance(found, Sized) else "")
        raise InputError(f"`matcher` returned {came}; two disparities are expected, the left and the right one")
    at_left, at_right = (check_disparity(one, rig, "what `matcher` returned") for one in found)
    return at_left, at_right


def check_disparity(disparity: Float32Array, rig: StereoRig, name: str) -> Float32Array:
    """H x W px, 0 where it is unknown (`known_disparity`). ShapeError or InputError, which call it `name`."""
    given = as_array(disparity, name)
    if given.ndim != 2 or given.dtype.kind not in "fiu":
        raise ShapeError(f"{name} is {given.dtype} {given.shape}; px as numbers, H x W, are expected")
    if given.dtype.kind != "f":
        raise InputError(
            f"{name} is {given.dtype}; pixels as floating-point numbers are expected: disparity / 16 of OpenCV's matchers, "
            "disparity.astype(np.float32) of pixels"
        )
    check_same_size(name, given.shape, "the pictures", rig.left.hw)
    return known_disparity(given, rig)
