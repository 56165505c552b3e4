"""Arguments of wrong types (oracles: the signatures themselves; laws: a DlamaError or a result, never another error, and what
is given stays as it was)."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import dlama
from dlama.arguments import check, check_arguments, check_count
from dlama.errors import DepthError, DlamaError, InputError, InputTypeError, ShapeError
from dlama.writing.atomic_write import PathLike

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

W, H = 32, 24
COLOR = np.random.default_rng(0).integers(0, 255, (H, W, 3), dtype=np.uint8)
DEPTH = np.full((H, W), 2, np.float32)
DEPTH[5:15, 10:20] = 1
CAMERA = dlama.Camera.from_fov(W, H, 60)
RGBD = dlama.RGBD(COLOR, DEPTH, CAMERA)
RIG = dlama.StereoRig(
    CAMERA, dlama.Camera.from_fov(W, H, 60, [[1, 0, 0, 0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
)
SCENE = dlama.scene([RGBD])
VIEW = dlama.render(RGBD, dlama.orbit(CAMERA, 10))
EXAMPLE = dlama.example()


def fill_with_grey(view: dlama.View, context: dlama.FillContext, seed: int) -> dlama.Fill:
    """The least of a filler."""
    return dlama.Fill(np.full_like(view.color, 128), np.full_like(view.depth, 3))


GOOD: dict[str, dict[str, Any]] = {
    "align_frames": {"frames": [RGBD, RGBD]},
    "batch": {"jobs": [], "out": "out", "workers": 1},
    "complete": {"rgbd": RGBD, "cameras": [CAMERA], "filler": fill_with_grey},
    "densify": {"rgbd": RGBD},
    "diagnose": {"first": "nothing.png", "second": "nothing.exr"},
    "estimate_depth": {"color": COLOR[:8, :8], "depth_model": lambda color: None},
    "find_mask": {"picture": RGBD, "clicks": [(1, 1)]},
    "fuse": {"scene": SCENE, "view": VIEW},
    "inpaint": {"view": VIEW, "inpainter": fill_with_grey, "context": dlama.FillContext.of(SCENE)},
    "lift": {"source": RGBD},
    "orbit": {"camera": CAMERA, "yaw": 3},
    "photo3d": {"rgbd": RGBD, "filler": fill_with_grey, "angle": 1.0, "distance": 0.0},
    "read_camera": {"path": EXAMPLE / "camera.json"},
    "read_color": {"path": EXAMPLE / "mask.png"},
    "read_mask": {"path": EXAMPLE / "mask.png"},
    "read_rgbd": {"image": "nothing.png", "depth": "nothing.exr"},
    "read_scene": {"path": "nothing.npz"},
    "read_stereo_calib": {"path": EXAMPLE / "calib.txt"},
    "remove": {"rgbd": RGBD, "mask": DEPTH < 2, "filler": fill_with_grey},
    "render": {"source": RGBD, "camera": CAMERA},
    "render_path": {"scene": SCENE, "cameras": [CAMERA], "filler": fill_with_grey},
    "scene": {"frames": [RGBD]},
    "sequence": {"dataset": "nothing"},
    "stereo": {"left": COLOR, "right": COLOR, "rig": RIG, "disparity": 2 * DEPTH, "filler": fill_with_grey},
    "view": {"rgbd": RGBD, "filler": fill_with_grey},
    "write": {"completion": None, "directory": "out", "only": "hole"},
    "write_photo3d": {"photo": None, "directory": "out", "only": "stereo"},
    "write_depth": {"rgbd": RGBD, "directory": "out"},
    "Camera": {"width": W, "height": H, "fx": 20.0, "fy": 20.0, "cx": 16.0, "cy": 12.0},
    "Camera.from_K": {"K": CAMERA.K, "width": W, "height": H},
    "Camera.from_fov": {"width": W, "height": H, "fov": 60},
    "Law.of": {"scene": SCENE},
    "FillContext.of": {"scene": SCENE},
    "MaskSession": {"picture": RGBD},
    "Mesh": {
        "vertices": np.zeros((3, 3)),
        "triangles": np.array([[0, 1, 2]], np.int32),
        "color": np.zeros((3, 3), np.uint8),
        "origin": np.zeros(3, np.uint8),
        "confidence": np.zeros(3, np.float32),
    },
    "PointCloud": {name: getattr(dlama.lift(RGBD), name) for name in ("points", "color", "origin", "confidence")},
    "RGBD": {"color": COLOR, "depth": DEPTH, "camera": CAMERA},
    "Recipe": {"name": "mine"},
    "Scene": {"frames": [VIEW]},
    "StereoRig": {"left": RIG.left, "right": RIG.right},
    "View": {name: getattr(VIEW, name) for name in VIEW.__dataclass_fields__},
    "View.from_rgbd": {"rgbd": RGBD},
}
"""Public functions, and types that are made from arguments, with arguments that cost little."""

BAD = {
    "None": None, "text": "abc", "no text": "", "number": 1.5, "negative": -1, "NaN": np.nan, "beyond any float": 10**400,
    "true": True, "list": [1], "no list": [], "list of None": [None], "dict": {"a": [1]}, "object": object(), "bytes": b"a",
    "a function": lambda *_: None, "float16": DEPTH.astype(np.float16), "objects": DEPTH.astype(object),
    "no array": np.zeros((0, 0)),
    "0-d": np.array(1.0), "NaNs": np.full((H, W), np.nan), "strided": COLOR[::-1, ::2], "one pixel": COLOR[:1, :1],
    "an RGBD": RGBD, "a View": VIEW, "a Camera": CAMERA, "no path": "a\0b", "a long name": "x" * 5000,
}  # fmt: skip
"""Values that fit few parameters."""


def in_order(result: object) -> object:
    """A result; of what is computed when it is asked for, all of it."""
    return list(result) if isinstance(result, Iterator) else result


@pytest.mark.parametrize("name", GOOD)
def test_bad_arguments_get_an_error_of_dlama(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: whatever one argument is, the function does its work or raises a DlamaError, and arrays stay as they were."""
    monkeypatch.chdir(tmp_path)
    function: Any = dlama
    for part in name.split("."):
        function = getattr(function, part)
    good = GOOD[name] | ({"completion": dlama.view(RGBD, filler=fill_with_grey)} if name == "write" else {})
    if name == "write_photo3d":
        good |= {"photo": dlama.photo3d(**GOOD["photo3d"])}
    others = {}
    for parameter in inspect.signature(function).parameters:
        if parameter not in ("defaults", "progress"):
            for called, bad in BAD.items():
                before = np.array(bad, copy=True) if isinstance(bad, np.ndarray) else None
                try:
                    in_order(function(**{**good, parameter: bad}))
                except DlamaError:
                    pass
                except Exception as error:
                    others[f"{parameter}: {called}"] = repr(error)
                if before is not None:
                    np.testing.assert_array_equal(before, bad, err_msg=f"{parameter}: {called}")
    assert others == {}


def test_every_public_function_is_among_them() -> None:
    """Guard: a public function that is added is put to the law above."""
    functions = {name for name in dlama.__all__ if inspect.isfunction(getattr(dlama, name))}
    assert functions - {"example"} <= set(GOOD)


def a_function(
    camera: dlama.Camera,
    cameras: Sequence[dlama.Camera] = (),
    inputs: Mapping[str, PathLike] | None = None,
    seconds: Mapping[str, float] | None = None,
    filler: str | Callable[[], object] = "layered",
    hw: tuple[int, int] | None = None,
    clicks: Sequence[tuple[float, float]] = (),
    only: Sequence[str] | None = None,
    sharpen: bool = True,
    mode: Literal["surface", "points"] | None = None,
) -> None:
    """Parameters of the kinds that public functions have."""


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"camera": "cam.json"}, r"^camera is of type str; a Camera is expected \(`read_camera\(\)` reads one\)$"),
        ({"camera": None}, "^camera is None; a Camera is expected"),
        ({"cameras": CAMERA}, "^cameras is of type Camera; a list of Cameras is expected$"),
        ({"cameras": [CAMERA, "cam.json"]}, r"^cameras\[1\] is of type str; a Camera is expected"),
        ({"inputs": [("depth", "depth.png")]}, "^inputs is of type list; a dict is expected$"),
        ({"inputs": {"depth": 3}}, r"^inputs\['depth'\] is of type int; a path is expected$"),
        ({"inputs": {3: "depth.png"}}, "^the key 3 of inputs is of type int; a string is expected$"),
        ({"seconds": {"read": "1"}}, r"^seconds\['read'\] is '1'; a number is expected$"),
        ({"filler": 3}, "^filler is of type int; a string or a function is expected$"),
        ({"hw": (3,)}, r"^hw is \(3,\); 2 numbers are expected$"),
        ({"hw": DEPTH}, r"^hw is \[\[.*; 2 numbers are expected$"),
        ({"clicks": [(1, 2, 3)]}, r"^clicks\[0\] is \(1, 2, 3\); 2 numbers are expected$"),
        ({"clicks": [(1, "2")]}, r"^clicks\[0\]\[1\] is '2'; a number is expected$"),
        ({"clicks": (1, 2)}, r"^clicks\[0\] is of type int; a list of numbers is expected$"),
        ({"clicks": 3}, "^clicks is of type int; a list of lists is expected$"),
        ({"only": 3}, "^only is of type int; a list of strings is expected$"),
        ({"sharpen": "no"}, "^sharpen is of type str; True or False is expected$"),
        ({"mode": 3}, "^mode is of type int; a name is expected$"),
    ],
)
def test_the_message_names_the_parameter_what_came_and_what_is_expected(given: dict[str, object], message: str) -> None:
    """An InputError, and a TypeError as of Python itself where the type is another."""
    with pytest.raises(InputError, match=message) as raised:
        check_arguments(a_function, {"camera": CAMERA, **given})
    assert isinstance(raised.value, TypeError)


def test_what_fits_passes() -> None:
    """Law: the types of the signature, and what stands for them: arrays of numbers, one name for a list of one, None."""
    for given in (
        {"cameras": (CAMERA,)}, {"inputs": {"depth": Path("a.png")}}, {"seconds": {"read": np.float32(1)}}, {"filler": print},
        {"hw": np.array([3, 4])}, {"clicks": np.ones((3, 2))}, {"clicks": []}, {"only": "image"}, {"only": {"image"}},
        {"sharpen": np.True_}, {"mode": "surface"}, {"inputs": None},
    ):  # fmt: skip
        check_arguments(a_function, {"camera": CAMERA, **given})
    check(1.5, Any, "anything")
    check_count(np.int64(1), "workers")


def test_counts() -> None:
    for bad in (0, 1.0, "2", np.nan):
        with pytest.raises(InputError, match=r"workers is .*; 1 or more is expected, a whole number"):
            check_count(bad, "workers")


def test_a_filler_that_returns_no_fill_is_reported_so() -> None:
    """Law: the message is about the filler; before, a bare AttributeError came from inside."""
    with pytest.raises(InputError, match="what the filler returned is None; a Fill is expected"):
        dlama.view(RGBD, yaw=10, filler=lambda view, context, seed: None)  # type: ignore[arg-type, return-value]


def test_depth_that_float32_cannot_hold_is_far() -> None:
    """Closed form: 1e300 m is beyond every far limit; numpy warned of a cast (tests make errors of warnings)."""
    done = dlama.view(RGBD, yaw=10, filler=lambda view, *_: dlama.Fill(view.color, np.full(view.depth.shape, 1e300)))  # type: ignore[arg-type]
    assert (done.view.depth[done.view.filled] == np.inf).all()


def test_notes_that_no_file_can_hold_are_refused_by_name(tmp_path: Path) -> None:
    """Law: the message shows the value and says whose it may be; json's own named neither."""
    notes = {"model": object()}
    done = dlama.view(
        RGBD, yaw=10, filler=lambda view, *_: dlama.Fill(view.color, np.ones_like(view.depth), notes=notes)
    )
    with pytest.raises(InputTypeError, match=r"meta data hold <object .*, of type object; .* notes of a filler"):
        dlama.write(done, tmp_path / "out", only=["image"])
    assert not (tmp_path / "out").exists()


def test_a_painter_paints_by_a_function() -> None:
    """Message: refused where it is made; before, where it was called, once all depth was filled."""
    with pytest.raises(InputTypeError, match="paint is of type int; a function is expected"):
        dlama.Painter(3)  # type: ignore[arg-type]


FAULTS_OF_PREDICTIONS = [
    ({"values": DEPTH.tolist()}, InputTypeError, "the estimated depth is of type list; an array is expected"),
    ({"values": DEPTH[:0]}, DepthError, r"has shape \(0, 32\); h x w is expected"),
    ({"values": DEPTH * 1j}, DepthError, "values that are not numbers"),
    (
        {"far": DEPTH > 1e9, "values": DEPTH[::2]},
        ShapeError,
        r"prediction.far is bool \(24, 32\); bool \(12, 32\) is expected",
    ),
    ({"far": np.full(DEPTH.shape, 0.1)}, ShapeError, "prediction.far is float64"),  # every pixel was sky
    ({"notes": [1]}, InputTypeError, "prediction.notes is of type list; a dict is expected"),
]


@pytest.mark.parametrize(("change", "kind", "message"), FAULTS_OF_PREDICTIONS)
def test_a_fault_of_an_estimator_is_named(change: dict[str, Any], kind: type[InputError], message: str) -> None:
    """Message: each field of a DepthPrediction; before, numpy's, OpenCV's or an attribute's error came from inside."""
    with pytest.raises(kind, match=message):
        dlama.estimate_depth(
            COLOR, CAMERA, depth_model=lambda _: dlama.DepthPrediction(**{"values": DEPTH, "metric": True} | change)
        )


NO_DEPTH = r"the filler's depth is 0, NaN, negative or no number in .* pixels of the hole"
FAULTS_OF_FILLS = [
    ({"color": COLOR[:3, :3]}, ShapeError, r"the filler's color has shape \(3, 3, 3\); \(24, 32, 3\) is expected"),
    ({"depth": np.full(DEPTH.shape, np.nan)}, DepthError, NO_DEPTH),  # went through into depth.exr, scene and mesh
    ({"depth": np.full(DEPTH.shape, -1.0)}, DepthError, NO_DEPTH),
    ({"depth": np.full(DEPTH.shape, 0.0)}, DepthError, NO_DEPTH),  # was known depth of high confidence
    ({"notes": None}, InputTypeError, "the filler's notes is None; a dict is expected"),
    ({"law_moves": "a"}, InputTypeError, "law_moves is 'a'; 0 or more is expected"),
    ({"depth": np.full(DEPTH.shape, "deep")}, DepthError, "no number in"),
    ({"depth": np.full(DEPTH.shape, 1e-300)}, DepthError, "the filler's depth is 0"),  # as float32, which views hold
    ({"errors": np.full((*DEPTH.shape, 2), np.nan)}, ShapeError, "the filler's errors are NaN or negative"),
    ({"depth": np.ma.masked_less(DEPTH, 100)}, InputTypeError, "the filler's depth is a masked array"),
]


@pytest.mark.parametrize(("change", "kind", "message"), FAULTS_OF_FILLS)
def test_a_fault_of_a_filler_is_named(change: dict[str, Any], kind: type[InputError], message: str) -> None:
    """Message: each field of a Fill; before, numpy's or an attribute's error came from inside."""

    def filler(view: dlama.View, context: dlama.FillContext, seed: int) -> dlama.Fill:
        return dlama.Fill(**{"color": view.color, "depth": np.ones_like(view.depth), **change})

    with pytest.raises(kind, match=message):
        dlama.view(RGBD, yaw=10, filler=filler)


def test_errors_of_a_filler_are_taken_in_any_float() -> None:
    """Closed form: the errors of the hole are those given."""

    def filler(view: dlama.View, context: dlama.FillContext, seed: int) -> dlama.Fill:
        return dlama.Fill(view.color, np.ones_like(view.depth), errors=np.full((*view.depth.shape, 2), 0.25))

    done = dlama.view(RGBD, yaw=10, filler=filler).view
    assert done.errors is not None and (done.errors[done.filled] == 0.25).all()


def test_an_unknown_keyword_is_refused_with_the_one_that_was_meant() -> None:
    """Law: of all that the function takes, its options and its own; the same where nothing is like it."""
    with pytest.raises(
        InputTypeError, match=r"yaww is no parameter of view; did you mean yaw\? It takes rgbd, camera, yaw"
    ):
        dlama.view(RGBD, yaww=20)
    with pytest.raises(InputTypeError, match=r"fillr is no parameter of complete; did you mean filler\?"):
        dlama.complete(RGBD, [CAMERA], fillr="telea")
    with pytest.raises(InputTypeError, match="xyz is no parameter of remove; it takes"):
        dlama.remove(RGBD, DEPTH < 2, xyz=1)
