"""What a visitor hands in: names, fields, facts, errors next to their field (oracles: by hand, the reader's own numbers)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from handing_in import completed, hand_in, open_frame

import dlama
from dlama.errors import CameraError, DepthError, DlamaError, FileError, InputError
from dlama.files.rasters.depth import read_depth
from dlama.web import api
from dlama.web.answers import PageError, field_of, hide_paths, use_page_words
from dlama.web.completions import take_home
from dlama.web.form import PARTS, labelled, read_form
from dlama.web.inputs import Upload, file_name
from dlama.web.visits import Visit
from marks import first_quick


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("photo.JPG", "photo.JPG"),
        ("../../etc/x.png", "x.png"),
        ("C:\\pictures\\a b.png", "a b.png"),
        ("über (1).png", "über (1).png"),
        ("$(rm)`;'.png", "_(rm)___.png"),
        ("-o.png", "o.png"),
        ("a" * 200 + ".png", "a" * 76 + ".png"),
    ],
)
def test_names_lose_folders_and_odd_signs(given: str, kept: str) -> None:
    """By hand; a name that another role has gets the role in front."""
    assert file_name(given, "picture", {})[0] == kept
    taken = {"picture": Upload(kept, Path("picture.png"))}
    assert file_name(given, "depth" if kept.endswith("png") else "right", taken)[0].endswith(kept)


@pytest.mark.parametrize(
    ("name", "role"), [("a.exe", "picture"), ("a.jpg", "depth"), ("noending", "calib"), ("a.png", "oops")]
)
def test_other_endings_are_refused(name: str, role: str) -> None:
    """The message says which are taken."""
    with pytest.raises(PageError, match="is expected"):
        file_name(name, role, {})


def test_fields_become_options() -> None:
    """By hand; empty ones say nothing, and none is a path."""
    fields = {
        "fov": "65.5",
        "far": 30,
        "depth_scale": "",
        "metres_at": "3,4=2.5 5,6=7",
        "resize_depth": "nearest",
        "else": "x",
    }
    assert read_form(fields, "lens", "depth") == {"fov": 65.5, "far": 30.0, "resize_depth": "nearest"}
    assert read_form(fields, "estimate") == {"metres_at": ((3, 4, 2.5), (5, 6, 7))}
    for name, value, field in (
        ("fov", "wide", "camera"),
        ("far", "inf", "scale"),
        ("metres_at", "3=4", "known"),
        ("filler", "lama", "method"),
    ):
        with pytest.raises(InputError) as caught:
            read_form({name: value}, *PARTS)
        assert field_of(caught.value, {}) == field
    assert read_form({"camera": "/etc/passwd", "depth_model": "/etc/passwd", "model": "/etc/passwd"}, *PARTS) == {}
    kinds = {Path, Path | None, str | Path | None}
    assert not any(one.kind in kinds for part in PARTS for one in labelled(part).values())


def test_what_was_found_is_reported(visit: Visit, frame: Path) -> None:
    """Closed form: a camera of 60 degrees, a wall at 4 m, a box at 2 m, millimetres."""
    facts = open_frame(visit, frame)["source"]["facts"]
    assert facts["picture"] == "64 x 48 pixels"
    assert facts["camera"] == "60.0° wide, fx 55.4 px, from fov"
    assert facts["depth"] == "2 to 4 m, 0 % missing, 0 % sky"
    assert facts["scale"].startswith("1000 units per metre")
    api.read(visit, {"fov": 60, "depth_scale": "500"})
    assert visit.source is not None and visit.source.facts["scale"] == "500 units per metre, as you chose"
    assert visit.source.rgbd.depth.max() == pytest.approx(8)


def test_the_camera_of_ros_is_taken(visit: Visit, frame: Path, tmp_path: Path) -> None:
    """By hand: K of camera_info, whose first pixel has its centre at 0."""
    (tmp_path / "cam.yaml").write_text(
        "image_width: 64\nimage_height: 48\ncamera_matrix:\n  data: [50., 0., 31.5, 0., 50., 23.5, 0., 0., 1.]\n",
        "utf-8",
    )
    hand_in(visit, "camera", tmp_path / "cam.yaml")
    open_frame(visit, frame, fov="")
    assert visit.source is not None
    camera = visit.source.rgbd.camera
    assert (camera.fx, camera.cx, camera.cy) == (50, 32, 24)


def test_a_pair_of_ros_is_taken(visit: Visit, tmp_path: Path) -> None:
    """By hand: P of the right camera's file, -fx * baseline in its last column; the left camera's has no baseline."""
    numbers = "256., 0., 256., {}, 0., 256., 256., 0., 0., 0., 1., 0."
    text = f"image_width: 512\nimage_height: 512\nprojection_matrix:\n  data: [{numbers}]\n"
    (tmp_path / "left.yaml").write_text(text.format("0."), "utf-8")
    with pytest.raises(PageError, match=r"^left\.yaml: its projection matrix has no baseline"):
        hand_in(visit, "calib", tmp_path / "left.yaml")
    (tmp_path / "right.yaml").write_text(text.format("-32."), "utf-8")
    for role, path in (("picture", "street.jpg"), ("right", "right.jpg")):
        hand_in(visit, role, dlama.example() / path)
    hand_in(visit, "calib", tmp_path / "right.yaml")
    assert api.read(visit, {})["source"]["facts"]["calib"] == "baseline 0.125 m"


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({}, "camera"),
        ({"fov": "200"}, "camera"),
        ({"fov": "60", "depth_scale": "-1"}, "scale"),
        ({"fov": 60, "far": 0.5}, "scale"),
    ],
)
def test_errors_stand_next_to_their_field(fields: dict[str, Any], field: str, visit: Visit, frame: Path) -> None:
    """By hand: what is missing or wrong, and where it is put right."""
    hand_in(visit, "picture", frame / "image.png")
    hand_in(visit, "depth", frame / "depth.png")
    with pytest.raises(DlamaError) as caught:
        api.read(visit, fields)
    files = {role: upload.path for role, upload in visit.files.items()}
    assert field_of(caught.value, files) == field


def test_two_pictures_may_be_no_pair(visit: Visit, frame: Path) -> None:
    """Depth whose name does not say so is taken for the right picture: the message says where to say it."""
    hand_in(visit, "picture", frame / "image.png")
    hand_in(visit, "right", frame / "depth.png", "1305031102.160407.png")
    with pytest.raises(
        PageError, match=r"calibration, .* is expected; where a picture is depth, .*Choose file by file"
    ) as caught:
        api.read(visit, {})
    assert caught.value.field == "calib"


def test_a_damaged_file_is_named_as_the_visitor_names_it(visit: Visit, frame: Path) -> None:
    """Nothing of where it lies is reported."""
    hand_in(visit, "picture", frame / "image.png")
    (frame / "broken.exr").write_bytes(b"no exr")
    hand_in(visit, "depth", frame / "broken.exr", "my depth.exr")
    with pytest.raises(FileError) as caught:
        api.read(visit, {"fov": 60})
    message = hide_paths(str(caught.value), visit.names())
    assert message.startswith("my depth.exr: ") and str(visit.folder) not in message
    assert field_of(caught.value, {role: upload.path for role, upload in visit.files.items()}) == "depth"


@pytest.mark.parametrize(
    ("message", "reported"),
    [
        ("give `fov`, or `camera`, a file", "give “Field of view”, or a camera file, a file"),
        ("or give `resize_depth=guided`", "or give “Bring depth to the picture's size”=guided"),
        ("a.json: fx is 3 and the camera is far", "a.json: fx is 3 and the camera is far"),
        ("`clicks` holds 3,4, which lies on a wall; far away", "a click holds 3,4, which lies on a wall; far away"),
        ("no depth is nearer than `far`, 3 m", "no depth is nearer than “Sky from”, 3 m"),
        ("or a metric `depth_model`", "or a metric network of depth (on the command line)"),
        ("see `depth_by` and `depth_scale=5`", "see depth_by and “Units per metre”=5"),
    ],
)  # fmt: skip
def test_messages_speak_of_the_page(message: str, reported: str) -> None:
    """By hand: parameters get the names of the page's fields, words of sentences and of files stay."""
    assert use_page_words(message) == reported


def test_kinds_of_errors_have_fields() -> None:
    """By hand."""
    assert field_of(CameraError("left_K is wrong"), {}) == "camera"
    assert field_of(DepthError("nothing"), {}) == "depth"
    assert field_of(InputError("`seed` is -1; more is expected"), {}) == "method"
    assert field_of(InputError("`clicks` holds 3,4, which lies on a wall"), {}) == "marks"
    assert field_of(InputError("something"), {}) == ""


def test_a_new_picture_forgets_what_came_of_the_old(visit: Visit, frame: Path) -> None:
    """Its marks and results are not the new one's."""
    open_frame(visit, frame)
    api.mark(visit, {"marks": [{"kind": "click", "at": [30, 24]}]})
    hand_in(visit, "picture", frame / "image.png", "other.png")
    assert visit.source is None and visit.mask is None and visit.result is None
    assert visit.files["picture"].name == "other.png"


@pytest.mark.parametrize(
    ("role", "name", "text", "message"),
    [
        (
            "camera",
            "notes.txt",
            "hello there",
            r"^notes\.txt: is no calib\.txt of Middlebury or KITTI and no K .*: a line is 'hello there'",
        ),
        ("camera", "meta.json", "{}", r"^meta\.json: field 'fx' is missing"),
        ("camera", "pose.yaml", "a: 1", r"^pose\.yaml: "),
        ("calib", "notes.txt", "hello there", r"^notes\.txt: is no calib\.txt"),
        ("picture", "image.png", "no picture", r"^image\.png: is no readable PNG"),
    ],
)
def test_a_file_that_is_refused_replaces_none(
    role: str, name: str, text: str, message: str, visit: Visit, frame: Path, tmp_path: Path
) -> None:
    """Oracle: the frame that was read before, which stays, and the folder of the visit."""
    open_frame(visit, frame)
    before = sorted(visit.folder.iterdir())
    (tmp_path / name).write_text(text)
    with pytest.raises(PageError, match=message) as caught:
        hand_in(visit, role, tmp_path / name)
    assert caught.value.field == role
    assert visit.source is not None and sorted(visit.folder.iterdir()) == before


@pytest.mark.filterwarnings("ignore:.*8 bits", "ignore:the scale of the estimated depth is assumed")
def test_inverse_depth_of_a_network_is_ticked(visit: Visit, frame: Path, tmp_path: Path) -> None:
    """Refused as depth, in the page's words; ticked it is used as estimated depth, which the command says, too (oracle: the
    reader with that option)."""
    depth = read_depth(frame / "depth.png", depth_scale=900)
    cv2.imwrite(str(tmp_path / "depth.png"), np.uint8(np.round(255 * depth.min() / depth)))
    hand_in(visit, "picture", frame / "image.png")
    hand_in(visit, "depth", tmp_path / "depth.png")
    with pytest.raises(DepthError, match="8-bit numbers") as caught:
        api.read(visit, {"fov": 60})
    assert "“Inverse depth of a network” takes what a network gave" in use_page_words(caught.value.marked)
    reported = api.read(visit, {"fov": 60, "inverse_depth": "true"})
    assert reported["source"]["estimated"] and "as a network gave it" in reported["source"]["facts"]["depth"]
    expected = dlama.read_rgbd(frame / "image.png", tmp_path / "depth.png", fov=60, inverse_depth=True).depth
    np.testing.assert_array_equal(visit.require_source().rgbd.depth, expected)
    how = take_home.how(completed(visit, yaw=2))
    assert " --inverse-depth " in how["command"] and "inverse_depth=True" in how["python"]


@pytest.mark.parametrize("name", first_quick(api.EXAMPLES, 2))
def test_examples_open(name: str, visit: Visit) -> None:
    """Each of them; of a pair the left picture has depth to click on."""
    reported = api.example(visit, {"name": name})
    assert (reported["source"]["width"], reported["source"]["pair"]) == (512, name == "pair")
    assert visit.source is not None and visit.source.rgbd.valid.mean() > 0.5
    assert reported["source"]["estimated"] == (name == "photo")
    with pytest.raises(PageError, match="one of street"):
        api.example(visit, {"name": "../street"})
