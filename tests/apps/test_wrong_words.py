"""Words that no verb takes (law: one line that names the flag, what came and what is expected; exit code 2; nothing is read)."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from running import error_line, refused

from dlama.apps.cli import VERBS, main
from dlama.apps.terminal.flags import flags_of
from dlama.apps.terminal.output import errors_as_lines
from dlama.apps.verbs.sequence import mask_files, read_masks
from dlama.errors import CameraError, DlamaError, InputError, MaskError


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("view a.png --yaw ten", "--yaw is 'ten'; a number is expected"),
        ("view a.png --yaw=-1,5", "--yaw is '-1,5'; a number is expected"),
        ("view a.png --pitch -10deg", "--pitch is '-10deg'; a number is expected"),
        ("view a.png --depth_scale mm", "--depth-scale is 'mm'; a number is expected"),
        ("view a.png --pivot here", "--pivot is 'here'; a number or auto is expected"),
        ("view a.png --seed 1.5", "--seed is '1.5'; a whole number is expected"),
        ("view a.png --mode mesh", "--mode is 'mesh'; surface or points is expected"),
        ("view a.png --resize-depth linear", "--resize-depth is 'linear'; guided or nearest is expected"),
        ("remove a.png --mask-polarity white", "--mask-polarity is 'white'; fill or known is expected"),
        ("evaluate data --yaws 10 ten", "--yaws is 'ten'; a number is expected"),
        ("evaluate data --protocol vpi all", "--protocol is 'all'; vpi, ori or sii is expected"),
        ("serve --port abc", "--port is 'abc'; a whole number is expected"),
        ("serve --max-pages 0", "--max-pages is 0; more than 0 is expected"),
        ("serve --max-megapixels nan", "--max-megapixels is nan; more than 0 is expected"),
        ("viwe a.png", "'viwe' is no verb of dlama; did you mean view? One of view, remove, "),
        ("photo.png", "'photo.png' is no verb of dlama; one of view, remove, "),
        (
            "view a.png b.png --yaw nan --pitch inf -o out",
            "--yaw is nan; a finite number is expected; --pitch is inf; a finite number is expected",
        ),
        ("view a.png b.png --yaw nan --fov 500 -o out", "--fov is 500 degrees; a field of view between 0 and 180"),
        (
            "view a.png b.png --yaw 1e308 -o out",
            "--yaw is 1e+308; an angle of -360 to 360 degrees is expected",
        ),
        (
            "view a.png b.png --yaw 1 --dilate-holes 99999 -o out",
            "--dilate-holes is 99999; a whole number from 0 to",
        ),
        ("view a.png --yaw 1 --metres-at 3,4=2 3,4=3 -o out", "--metres-at 3,4: is 2 m and 3 m; one depth of a pixel"),
        ("view a.png b.png --yaw 1 --clip 1e-9 -o out", "--clip is 1e-09 m; 0.01 or more is expected"),
        ("mask a.png b.png --click 1,1 -o found.txt", "--output is found.txt; a name that ends in .png is expected"),
        ("view a.png b.png --yaw 1 --only foo,depth,bar -o out", "--only is 'foo', 'bar'; names of image, depth, "),
        (
            "view a.png b.png --yaw 1 --only disparity -o out",
            "disparity is to be written, which only the pictures of a stereo pair have",
        ),
        (
            "remove a.png b.png --click 3,3 --mask-class 9,9,9 -o out",
            "--mask-class says how a mask file is read, and none",
        ),
        (
            "stereo a.png b.png --calib c.txt --mask-polarity known -o out",
            "--mask-polarity says how a mask file is read",
        ),
        ("stereo a.png b.png --calib c.txt --with-shadow -o out", "--with-shadow is for clicks and boxes, and neither"),
        ("sequence . --soft-mask -o out", "--soft-mask says how a mask file is read, and none is given"),
        ("video a.npz --layout tum -o a.gif", "--layout says how a data set is read, and a.npz is a scene"),
        (
            "view a.png b.png --yaw 1 -o s3://bucket/out",
            "--output is s3:/bucket/out; a directory is expected, addresses are",
        ),
        ("photo3d . --fov 60 -o out", "--fov does not apply to a data set (.); it is for pictures"),
        ("photo3d . a.png -o out", ".: is a data set, which has its depth; a.png does not apply to it"),
        ("batch a.csv --workers 0 --threads 0 -o out", "a whole number; --threads is 0; 1 or more is expected"),
        ("batch --images *.png -o out", "give --verb VERB, one of view, remove, depth"),
    ],
)
def test_one_line_says_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in error_line(capsys, *words.split())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("error", "guide"), [(CameraError, "concepts/conventions"), (MaskError, "guides/remove")])
def test_an_error_names_the_guide_that_explains_it(
    capsys: pytest.CaptureFixture[str], error: type[DlamaError], guide: str
) -> None:
    """Law: on the same line, and the page is there; an error that no page explains (InputError) has no such end."""
    for kind, end in ((error, f"wrong (see docs/{guide}.md)\n"), (InputError, "wrong\n")):
        with pytest.raises(SystemExit), errors_as_lines():
            raise kind("wrong")
        assert capsys.readouterr().err == f"error: {end}"
    assert (Path(__file__).parents[2] / error.guide).is_file()


def test_without_arguments_the_usual_commands_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    """Law: each begins with a verb that there is, and takes the options that stand there; exit code 0; 80 columns are enough."""
    main([])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    shown = [line.split() for line in lines if line.startswith("    ")]
    assert [words[:2] for words in shown] == [["dlama", verb] for verb in ("view", "remove", "stereo", "serve")]
    for words in shown:
        flags = flags_of(VERBS[words[1]]).values()
        assert all(word in flags for word in words if word.startswith("--"))


@pytest.mark.parametrize("flag", ["-o", "--camera"])
def test_an_empty_word_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], flag: str
) -> None:
    """Of an unset variable of a shell: `-o ""` wrote into the working directory."""
    monkeypatch.chdir(tmp_path)
    assert f"{flag} is empty; a value is expected" in refused(capsys, tmp_path, "view", "a.png", "--yaw", 1, flag, "")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_no_file(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It was called empty; reading it would wait for ever, and /dev/zero would never end."""
    os.mkfifo(frame / "pipe.png")
    for words in ((frame / "pipe.png", "depth.png", "--fov", 60), ("image.png", "depth.png", "--camera", "/dev/zero")):
        told = refused(capsys, frame, "view", *words, "--yaw", 5)
        assert "is a pipe or device, a file on disk is expected" in told


def test_a_folder_of_masks_is_one_and_holds_some(tmp_path: Path) -> None:
    for folder, words in ((tmp_path / "none", "a folder of masks"), (tmp_path, "which holds no picture")):
        with pytest.raises(InputError, match=f"masks is {folder}.*{words}"):
            mask_files((), folder)


def test_two_masks_of_one_frame_are_refused(tmp_path: Path) -> None:
    """The last one by name was taken without a word (oracle: the files)."""
    for name in ("a.jpg", "a.png", "b.png"):
        (tmp_path / name).touch()
    with pytest.raises(InputError, match=r"frame a has two, .*a\.jpg and a\.png"):
        mask_files((), tmp_path)


def test_black_masks_among_others_are_passed_over(tmp_path: Path) -> None:
    """As a segmenter of videos writes them where the object is out of view; all of them black, or 1 for 255, are refused."""
    mask = np.zeros((4, 6), np.uint8)
    files = {name: tmp_path / f"{name}.png" for name in ("black", "marked")}
    Image.fromarray(mask).save(files["black"])
    mask[1, 2] = 255
    Image.fromarray(mask).save(files["marked"])
    assert [name for name, found in read_masks(files).items() if found.any()] == ["marked"]
    with pytest.raises(MaskError, match=r"black.png: the mask is empty"):
        read_masks({"black": files["black"]})
    Image.fromarray(mask // 255).save(files["black"])
    with pytest.raises(MaskError, match=r"its largest value is 1; 255 means remove"):
        read_masks(files)
