"""Confidence of filled pixels (oracles: closed forms, laws of scale, and the truth of a world that was not trained on)."""

from __future__ import annotations

import dataclasses

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.inpainters.confidence import (
    FEATURES,
    OUTPUTS,
    ConfidenceNetwork,
    feature_rows,
    features_of_known,
    judge_fill,
)


def holed(size: int = 96, scale: float = 1.0) -> tuple[View, np.ndarray, np.ndarray]:
    """A slanted, textured wall with a hole of two types and a sensor hole; and a filled colour and depth."""
    rng = np.random.default_rng(3)
    color = rng.integers(60, 200, (size, size, 3), np.uint8)
    depth = (scale * np.linspace(2, 4, size)[None] * np.ones((size, 1))).astype(np.float32)
    missing = depth.copy()
    missing[5:12, 5:12] = 0
    view = View.from_rgbd(RGBD(color, missing, Camera.from_fov(size, size, 60)))
    where = np.zeros((size, size), bool)
    where[30:60, 30:60] = True
    view = view.without(where, HoleType.DISOCCLUDED)
    where[:] = False
    where[:, -10:] = True
    return view.without(where, HoleType.OUT_OF_VIEW), color, depth


def test_the_network_is_what_its_weights_say() -> None:
    """Closed form: zero weights leave the last biases: a probability, and an error by its logarithm, at most all of the depth; a
    unit weight passes one feature on."""
    zeros = [np.zeros(shape, np.float32) for shape in ((FEATURES, 4), (4, 4), (4, OUTPUTS))]
    biases = [np.zeros(4, np.float32), np.zeros(4, np.float32), np.log(np.array([1, 3, 0.25, 2], np.float32))]
    layers = tuple(zip(zeros, biases))
    network = ConfidenceNetwork(np.zeros(FEATURES, np.float32), np.ones(FEATURES, np.float32), layers)
    features = np.ones((5, FEATURES), np.float32)
    probabilities, errors = network(features)
    np.testing.assert_allclose(probabilities, [[0.5, 0.75]] * 5, rtol=1e-6)
    np.testing.assert_allclose(errors, [[0.25, 50]] * 5, rtol=1e-5)
    zeros[0][2, 0] = zeros[1][0, 0] = zeros[2][0, 0] = 1
    assert np.allclose(network(2 * features)[0][:, 0], 1 / (1 + np.exp(-2)))
    biases[2][2:] = 9
    np.testing.assert_allclose(network(features[:1])[1], [[1, 255]])


def test_known_pixels_keep_theirs_and_depth_alone_is_surer() -> None:
    """Law: outside the hole nothing changes; inside 0 <= p <= 1; where the colour is measured, only depth can be wrong."""
    view, color, depth = holed()
    found = judge_fill(view, color, depth)[0]
    assert found.dtype == np.float32 and np.array_equal(found[~view.hole], view.confidence[~view.hole])
    assert (found[view.hole] > 0).all() and (found[view.hole] < 1).all()
    sensor = view.hole & ~view.color_hole
    both = dataclasses.replace(view, origin=np.where(sensor, np.uint8(0), view.origin))
    assert (found[sensor] >= judge_fill(both, color, depth)[0][sensor]).all()


def test_features_know_no_scale() -> None:
    """Law: a scene ten times as large has the same features."""
    small, large = (
        feature_rows(features_of_known(view), color, depth).T for view, color, depth in (holed(), holed(scale=10.0))
    )
    assert small.shape == (int(holed()[0].hole.sum()), FEATURES)
    np.testing.assert_allclose(small, large, atol=2e-3)


def test_estimated_depth_is_trusted_less() -> None:
    """Closed form: its feature is 1 where depth is estimated, 0 where it is measured; all others are the same. Law: of two views
    that differ in that alone, the estimated one's fills are less likely right."""
    view, color, depth = holed()
    rgbd = RGBD(view.color, np.where(view.hole, 0, view.depth), view.camera, estimate={"estimator": "mine"})
    estimated = dataclasses.replace(view, origin=np.where(view.hole, view.origin, View.from_rgbd(rgbd).origin))
    features = [feature_rows(features_of_known(one), color, depth).T for one in (view, estimated)]
    np.testing.assert_array_equal(features[0][:, :-1], features[1][:, :-1])
    assert (features[0][:, -1] == 0).all() and (features[1][:, -1] == 1).all()
    measured, guessed = (judge_fill(one, color, depth)[0][view.hole] for one in (view, estimated))
    assert (guessed < measured).all()
