"""The verb `mask`, run on a small frame: the mask of a click against the frame's true mask, and bad input in one line."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from running import FAST, error_line, pixels, run

import dlama
from box_frame import CAMERA, WORLD, small_frame
from dlama.apps.cli import main
from dlama.apps.reading import mask_notes, remaining_shadow
from dlama.jobs import inputs
from dlama.jobs.batch import JobList
from dlama.jobs.perform import Task, work
from dlama.jobs.storage import Output


def test_a_click_writes_mask_and_overlay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = small_frame(tmp_path)
    true = pixels(folder / "mask.png") > 0
    files = [str(folder / "image.png"), str(folder / "depth.png")]
    main(["mask", *files, "--fov", "60", "--click", "30,25", "-o", str(folder / "found.png")])
    found = pixels(folder / "found.png")
    assert set(found.ravel().tolist()) == {0, 255}
    assert ((found > 0) ^ true).sum() < 0.05 * true.sum()
    assert pixels(folder / "found_overlay.png").shape == (48, 64, 3)
    assert "found.png: object by rgbd" in capsys.readouterr().out


@pytest.mark.slow
def test_a_mask_of_a_photo_alone_warns_of_no_metres(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Law: a mask does not change with the scale of estimated depth, nor with an assumed lens, so nothing is said of them."""
    folder = small_frame(tmp_path)
    np.save(folder / "inverse.npy", 1 / pixels(folder / "depth.png").clip(1).astype(np.float32))
    for depth in ([], [str(folder / "inverse.npy"), "--inverse-depth"]):
        main(["mask", str(folder / "image.png"), *depth, "--box", "15,12,30,28", "-o", str(folder / "found.png")])
        said = capsys.readouterr()
        assert said.err == "" and "found in estimated depth" in said.out


def test_a_result_continues_without_a_further_object(frame: Path) -> None:
    """By its scene.npz (oracle: the picture that the removal of both at once gives), or by image, depth and meta.json (oracle:
    the plane at 4 m). `remove` and `mask` refused a scene, and meta.json was no camera."""
    picture, rest = ["image.png", "depth.png"], ["--fov", "60", *FAST]
    square = np.zeros((48, 64), np.uint8)
    square[3:9, 50:58] = 255
    Image.fromarray(square).save(frame / "square.png")
    Image.fromarray(square | pixels(frame / "mask.png")).save(frame / "both.png")
    both = pixels(run(frame, "remove", *picture, "both.png", *rest) / "image.png")
    run(frame, "remove", *picture, "square.png", *rest, "--also", "scene").rename(frame / "first")
    main(["mask", str(frame / "first" / "scene.npz"), "--click", "30,25", "-o", str(frame / "found.png")])
    true, found = pixels(frame / "mask.png") > 0, pixels(frame / "found.png") > 0
    assert (true ^ found).sum() < 0.05 * true.sum()
    for words in (["mask.png"], ["--click", "30,25"]):
        further = run(frame, "remove", "first/scene.npz", *words, *FAST)
        assert (pixels(further / "image.png") == both).all() or "--click" in words
        assert abs(pixels(further / "depth.png")[true].astype(float) - 4000).max() < 40
    files = ["first/image.png", "first/depth.exr", "mask.png", "--camera", "first/meta.json"]
    assert abs(pixels(run(frame, "remove", *files, *FAST) / "depth.png")[true].astype(float) - 4000).max() < 40


def test_of_many_frames_the_middle_one_is_clicked(tmp_path: Path) -> None:
    """Oracle: the object's own mask of that frame, given to the same scene."""
    frames = [WORLD.rgbd(dlama.orbit(CAMERA, yaw, pivot=3)) for yaw in (-8, 0, 8)]
    dlama.write(dlama.complete(dlama.scene(frames), [CAMERA], filler="telea"), tmp_path / "done", also=["scene"])
    file, mask = str(tmp_path / "done" / "scene.npz"), WORLD.trace(CAMERA)[1] == 1
    main(["remove", file, "--click", "30,25", *FAST, "--also", "mask", "-o", str(tmp_path / "out")])
    found = pixels(tmp_path / "out" / "mask.png") > 0
    assert (mask ^ found).sum() < 0.05 * mask.sum()
    expected = dlama.remove(dlama.read_scene(file), {1: found}, filler="telea").view.color
    np.testing.assert_array_equal(pixels(tmp_path / "out" / "image.png"), expected)


def test_what_to_know_of_a_mask_is_in_the_last_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Law: of `mask` and of `remove` alike, once; a shadow that is not there has no share."""
    folder = small_frame(tmp_path)
    words = ["image.png", "depth.png", "--click", "30,25", "--with-shadow", "--fov", "60"]
    run(folder, "remove", *words, *FAST)
    removed = capsys.readouterr().out
    main(["mask", *(str(folder / word) if ".png" in word else word for word in words), "-o", str(folder / "found.png")])
    found = capsys.readouterr().out
    for line in (removed, found):
        assert line.rstrip().endswith(" s; no shadow found") and "of it shadow" not in line
    assert (
        mask_notes("object", ["part", "object", "group"], ["look"])
        == "; --candidate part or group gives another mask; look"
    )
    assert mask_notes("object", ["object"], []) == ""


def test_a_shadow_that_stays_is_in_the_last_line() -> None:
    """Law: with the option that removes it, until it was given; a few dark pixels, next to those of the object, are no shadow,
    however much else is filled."""
    grown = {"mask_pixels": 800, "mask_known_pixels_given_up": 200}
    meta = {"filled_pixels": 50000, "dilation": grown, "notes": {"remaining_shadow_px": 300}}
    assert "300 pixels" in remaining_shadow(meta, with_shadow=False)
    assert "--with-shadow" in remaining_shadow(meta, with_shadow=False)
    assert remaining_shadow(meta, with_shadow=True) == ""
    assert remaining_shadow(meta | {"notes": {"remaining_shadow_px": 5}}, with_shadow=False) == ""
    assert remaining_shadow(meta | {"notes": {}}, with_shadow=False) == ""
    nothing = {"mask_pixels": 0, "mask_known_pixels_given_up": 0}
    assert remaining_shadow(meta | {"dilation": nothing}, with_shadow=False) == ""


def easysynth_frame(tmp_path: Path) -> Path:
    """The small frame in folders as EasySynth names them, with a semantic picture (the box is 255, 0, 0)."""
    folder = small_frame(tmp_path)
    for name in ("ColorImage", "SemanticImage"):
        (folder / name).mkdir()
    (folder / "image.png").rename(folder / "ColorImage" / "seq.0000.png")
    semantic = np.where((pixels(folder / "mask.png") > 0)[..., None], (255, 0, 0), (0, 0, 0)).astype(np.uint8)
    Image.fromarray(semantic).save(folder / "SemanticImage" / "seq.0000.png")
    (folder / "SemanticClasses.csv").write_text("barrel,255,0,0\nground,0,0,0\n")
    return folder


def test_a_class_of_the_semantic_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The class by name, without depth (oracle: the true mask); without a semantic picture there is one line."""
    folder = easysynth_frame(tmp_path)
    image = str(folder / "ColorImage" / "seq.0000.png")
    main(["mask", image, "--class", "barrel", "-o", str(folder / "found.png")])
    np.testing.assert_array_equal(pixels(folder / "found.png"), pixels(folder / "mask.png"))
    capsys.readouterr()
    semantic, other = folder / "SemanticImage" / "seq.0000.png", ("-o", str(folder / "other.png"))
    line = error_line(capsys, "mask", image, "--class", "barrel", "--candidate", "part", *other)
    assert "--class and other ways to point at an object contradict each other" in line
    line = error_line(capsys, "mask", image, "--class", "barrel", "-o", str(semantic))
    assert "an input of this run (semantic picture)" in line and pixels(semantic).ndim == 3
    Image.open(semantic).resize((24, 32), Image.Resampling.NEAREST).save(semantic)
    line = error_line(capsys, "mask", image, "--class", "barrel", *other)
    assert "seq.0000.png is 24x32 and " in line and "both must have the same size" in line
    semantic.unlink()
    line = error_line(capsys, "mask", image, "--class", "barrel", *other)
    assert "no semantic picture belongs to it" in line


@pytest.mark.slow
def test_a_mask_file_gets_its_shadow(tmp_path: Path) -> None:
    """Oracle: the same object clicked, and its shadow found with it. `--with-shadow` of a mask file did nothing; in a row
    of a list it does the same."""
    street, files = dlama.example(), [str(tmp_path / name) for name in ("street.png", "depth.png")]
    for name, file in zip(("street.jpg", "depth.png"), files):
        Image.fromarray(pixels(street / name)[::2, ::2]).save(file)
    rest = ["--fov", "90", *FAST, "--only", "mask,image", "-o"]
    main(["mask", *files, "--fov", "90", "--click", "128,172", "-o", str(tmp_path / "found.png")])
    main(["remove", *files, "--click", "128,172", "--with-shadow", *rest, str(tmp_path / "clicked")])
    main(["remove", *files, str(tmp_path / "found.png"), "--with-shadow", *rest, str(tmp_path / "given")])
    masks = [pixels(tmp_path / one / "mask.png") for one in ("clicked", "given")]
    assert (masks[0] == masks[1]).all() and masks[1].sum() > 1.05 * pixels(tmp_path / "found.png").sum()
    about = json.loads((tmp_path / "given" / "meta.json").read_text())["object_mask"]
    assert about["masker"] == "a mask file" and about["with_shadow"] is True
    (tmp_path / "jobs.csv").write_text(
        f"id,verb,image,depth,mask,with_shadow\nlisted,remove,{files[0]},{files[1]},found.png,true\n"
    )
    (job,) = JobList(tmp_path / "jobs.csv", None, {"fov": 90, "filler": "telea", "only": "mask"})
    assert work(Task(job, Output(str(tmp_path / "many")))).status == "done"
    assert (pixels(tmp_path / "many" / "listed" / "mask.png") == masks[1]).all()


@pytest.mark.slow
def test_seconds_have_the_estimate_of_depth_and_the_mask(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: delays that are put in; they stood under `read`, or nowhere."""

    def slower(function: Callable[..., Any], seconds: float) -> Callable[..., Any]:
        def run_later(*args: Any, **named: Any) -> Any:
            time.sleep(seconds)
            return function(*args, **named)

        return run_later

    monkeypatch.setattr(inputs, "read_rgbd", slower(inputs.read_rgbd, 0.3))
    monkeypatch.setattr(inputs, "find_pointed", slower(inputs.find_pointed, 0.2))
    folder, out = small_frame(tmp_path), tmp_path / "out"
    words = ["--fov", "60", "--click", "30,25", "--metres-at", "2,2=4", *FAST]
    main(["remove", str(folder / "image.png"), *words, "--only", "image", "--json", "-o", str(out)])
    for seconds in (
        json.loads((out / "meta.json").read_text())["seconds"],
        json.loads(capsys.readouterr().out)["seconds_by_stage"],
    ):
        assert "read" not in seconds and {"prepare", "fill", "write"} <= set(seconds)
        assert seconds["read_and_estimate_depth"] >= 0.3 and seconds["find_mask"] >= 0.2
