"""How near filled depth may be: against the law itself, a slow march, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import dolly, orbit
from dlama.geometry.visibility import Law
from dlama.training.data.samples.views import law_limit
from reference.limit import limit as marched

CAMERA = Camera.from_fov(28, 22, 80)
GOALS = {"yaw 25": orbit(CAMERA, 25), "yaw -40, up": orbit(CAMERA, -40, 10), "back": dolly(CAMERA, -0.7)}


def measured() -> np.ndarray:
    """A near box before a slanted wall, with sky above and some pixels missing."""
    depth = np.linspace(3, 5, 28, dtype=np.float32)[None].repeat(22, 0)
    depth[8:18, 9:17] = 1.5
    depth[:4], depth[10:13, 20:23] = np.inf, 0
    return depth


def truths(law: Law, goal: Camera) -> np.ndarray:
    """Random lawful inverse depths, some far."""
    rng = np.random.default_rng(4)
    depth = rng.uniform(0.8, 9, goal.hw).astype(np.float32)
    lawful, _ = law.project(goal, depth, np.ones(goal.hw, bool))
    return (1 / lawful.astype(np.float64)).astype(np.float32)


@pytest.mark.parametrize("name", GOALS)
def test_at_the_limit_lawful_above_it_not(name: str) -> None:
    """Oracle: Law.violations. From the truth to the limit nothing breaks the law, just above the limit everything does."""
    goal, law = GOALS[name], Law(((CAMERA, measured()),))
    every = np.ones(goal.hw, bool)
    true = truths(law, goal)
    limit = law_limit(law, goal, true, every)
    assert (limit >= true).all() and np.isfinite(limit).mean() > 0.2
    finite = np.isfinite(limit) & (limit > 1e-4)
    with np.errstate(divide="ignore"):
        above = (1 / (limit.astype(np.float64) * (1 + 2e-6))).astype(np.float32)
        assert law.violations(goal, above, every)[finite].all()
        top = np.where(np.isfinite(limit), limit, 50)
        for share in np.linspace(0, 1, 40):
            w = true + share * (top * (1 - 2e-6) - true).clip(min=0)
            assert not law.violations(goal, (1 / w).astype(np.float32), (w > 0) & (limit > true * (1 + 1e-5))).any()


@pytest.mark.parametrize("name", GOALS)
def test_as_the_slow_march(name: str) -> None:
    """Oracle: the literal twin, up to its step. (Stretches shorter than a step it may miss: 1 % of the pixels.)"""
    goal, law = GOALS[name], Law(((CAMERA, measured()),))
    true = truths(law, goal)
    where = np.random.default_rng(1).random(goal.hw) < 0.4
    slow, step = marched(goal, true, where, CAMERA, measured())
    fast = law_limit(law, goal, true, where)
    same = (np.abs(np.minimum(fast, 19.9) - np.minimum(slow, 19.9)) <= 1.1 * step) | ~where
    assert same.mean() > 0.99 and np.isinf(fast[~where]).all()


def test_behind_a_removed_object_is_its_own_depth() -> None:
    """At the source's own camera the limit is what was measured there, less the tolerance of 0.1 %; far: nothing finite."""
    depth = measured()
    law = Law(((CAMERA, depth),))
    limit = law_limit(law, CAMERA, np.zeros(CAMERA.hw, np.float32), np.ones(CAMERA.hw, bool))
    seen = (depth > 0) & np.isfinite(depth)
    assert np.allclose(limit[seen], 1 / (depth[seen] * 0.999), rtol=1e-5)
    assert (limit[np.isinf(depth)] == 0).all() and np.isinf(limit[depth == 0]).all()


def test_two_sources_the_stricter_one_counts() -> None:
    """Oracle: each source alone."""
    goal, other = GOALS["yaw 25"], orbit(CAMERA, 50)
    sources = (CAMERA, measured()), (other, np.full(other.hw, 2.0, np.float32))
    both, every = Law(sources), np.ones(goal.hw, bool)
    true = truths(both, goal)
    alone = [law_limit(Law((one,)), goal, true, every) for one in sources]
    assert np.array_equal(law_limit(both, goal, true, every), np.minimum(*alone))
