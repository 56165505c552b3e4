"""What a completion gives back: what is computed from the scene is computed once, and one line says what it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from small_street import CAMERA, MASK, completed, street

from dlama.completion import completion as module
from dlama.completion.pipeline import complete
from dlama.completion.report import hole_shares
from dlama.completion.verbs import remove, view
from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import orbit


def test_clouds_and_mesh_are_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: asked for twice they are the same objects, and the scene was gone through once for each; so it is a guard that
    fails when a property is computed again."""
    calls = []
    for name in ("scene_cloud", "scene_mesh"):
        whole = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *a, _n=name, _f=whole, **k: (calls.append(_n), _f(*a, **k))[1])
    done = remove(street(), MASK, filler="telea")
    for name in ("completed", "background", "mesh"):
        assert getattr(done, name) is getattr(done, name)
    assert calls == ["scene_cloud", "scene_cloud", "scene_mesh"]
    assert len(done.completed) > len(done.background)


def test_one_line_says_what_it_is() -> None:
    """Frozen: type, views and their size, what share lacked colour, filler and recipe; no arrays."""
    done = completed("dlama", "telea", True, 0.0)
    share = 100 * done.meta["hole_share"][0]
    assert repr(done) == f"Completion(1 view of 128x96, {share:.1f} % was unknown, filled by 'telea', recipe 'dlama')"
    two = complete(street(), [CAMERA, orbit(CAMERA, 5)], filler="telea")
    assert repr(two).startswith("Completion(2 views of 128x96, ")
    assert repr(complete(street(), [], mask=MASK, filler="telea")) == (
        "Completion(0 views, filled by 'telea', recipe 'dlama')"
    )


def test_shares_by_type() -> None:
    """Closed form: 3 of 12 pixels out of view, 1 an object, and NONE is not listed."""
    shares = hole_shares(np.array([[4, 4, 4, 0], [0, 6, 0, 0], [0, 0, 0, 0]], np.uint8))
    assert shares.pop("out_of_view") == 0.25 and shares.pop("object") == 1 / 12
    assert set(shares) == {"crack", "disoccluded", "flying", "sensor"} and not any(shares.values())


def test_no_camera_is_refused_where_there_is_nothing_to_do() -> None:
    """Without a mask; with one the scene is there, and a view that is not says so."""
    with pytest.raises(InputError, match="cameras is empty; one camera or more is expected"):
        complete(street(), [])
    done = complete(street(), [], mask=MASK, filler="telea")
    assert len(done.mesh.vertices) > 100
    with pytest.raises(InputError, match="the completion has no view"):
        print(done.view)


@pytest.mark.parametrize("verb", [view, lambda color, **move: remove(color, np.eye(8, dtype=bool), **move)])
def test_a_picture_without_depth_is_refused_with_advice(verb: Callable[..., object]) -> None:
    """Law: the first thing that people try, an array of colours, gets the names of what makes an RGBD of it."""
    with pytest.raises(InputError, match=r"rgbd is of type ndarray; an RGBD.* expected.*read_rgbd.*estimate_depth"):
        verb(np.zeros((8, 8, 3), np.uint8), yaw=5)
    with pytest.raises(
        InputError, match=r"rgbd is of type ndarray; an RGBD, a Scene or a list of RGBDs or functions is expected"
    ):
        complete(np.zeros((8, 8, 3), np.uint8), [Camera.from_fov(8, 8, 60)])  # type: ignore[arg-type]
