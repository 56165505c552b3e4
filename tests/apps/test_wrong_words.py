"""Words that no verb takes (law: one line that names the flag, what came and what is expected; exit code 2; nothing is read)."""

from __future__ import annotations

import os
import shlex
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
from dlama.files.rasters.masks import read_mask

WRONG = """
view a.png --yaw ten => --yaw is 'ten'; a number is expected
view a.png --yaw=-1,5 => --yaw is '-1,5'; a number is expected
view a.png --pitch -10deg => --pitch is '-10deg'; a number is expected
view a.png --depth_scale mm => --depth-scale is 'mm'; a number is expected
view a.png --pivot here => --pivot is 'here'; a number or auto is expected
view a.png --seed 1.5 => --seed is '1.5'; a whole number is expected
view a.png --mode mesh => --mode is 'mesh'; surface or points is expected
view a.png --resize-depth linear => --resize-depth is 'linear'; guided or nearest is expected
remove a.png --mask-polarity white => --mask-polarity is 'white'; fill or known is expected
evaluate data --yaws 10 ten => --yaws is 'ten'; a number is expected
evaluate data --protocol vpi all => --protocol is 'all'; vpi, ori or sii is expected
sequence room -o out --mask 0=a.png --mask 1=b.png => --mask is given twice; all its values behind one --mask are expected
photo3d a.png -o out --also spz --also=usdz => --also is given twice; all its values behind one --also are expected
serve --port abc => --port is 'abc'; a whole number is expected
serve --port 99999 => --port is 99999; 0 to 65535 is expected
serve --host nowhere.invalid --token x => --host is nowhere.invalid, --port is 7860:
serve --host 0.0.0.0 --quiet => give --token
serve --max-pages 0 => --max-pages is 0; more than 0 is expected
serve --max-megapixels nan => --max-megapixels is nan; more than 0 is expected
viwe a.png => 'viwe' is no verb of dlama; did you mean view? One of view, remove,
photo.png => 'photo.png' is no verb of dlama; one of view, remove,
view a.png b.png --yaw nan --pitch inf -o out => --yaw is nan; a finite number is expected; --pitch is inf; a finite number is
view a.png b.png --yaw nan --fov 500 -o out => --fov is 500 degrees; a field of view between 0 and 180
view a.png b.png --yaw 1e308 -o out => --yaw is 1e+308; an angle of -360 to 360 degrees is expected
view a.png b.png --yaw 1 --dilate-holes 99999 -o out => --dilate-holes is 99999; a whole number from 0 to
view a.png --yaw 1 --metres-at 3,4=2 3,4=3 -o out => --metres-at 3,4: is 2 m and 3 m; one depth of a pixel
view a.png b.png --yaw 1 --clip 1e-9 -o out => --clip is 1e-09 m; 0.01 or more is expected
mask a.png b.png --click 1,1 -o found.txt => --output is found.txt; a name that ends in .png is expected
view a.png b.png --yaw 1 --only foo,depth,bar -o out => --only is 'foo', 'bar'; names of image, depth,
view a.png b.png --yaw 1 --only disparity -o out => disparity is to be written, which only the pictures of a stereo pair have
remove a.png b.png --click 3,3 --mask-class 9,9,9 -o out => --mask-class says how a mask file is read, and none
stereo a.png b.png --calib c.txt --mask-polarity known -o out => --mask-polarity says how a mask file is read
stereo a.png b.png --calib c.txt --with-shadow -o out => --with-shadow is for clicks and boxes, and neither
sequence . --soft-mask -o out => --soft-mask says how a mask file is read, and none is given
video a.npz --layout tum -o a.gif => --layout says how a data set is read, and a.npz is a scene
view a.png b.png --yaw 1 -o s3://bucket/out => --output is s3:/bucket/out; a directory is expected, addresses are
photo3d . --fov 60 -o out => --fov does not apply to a data set (.); it is for pictures
photo3d . a.png -o out => .: is a data set, which has its depth; a.png does not apply to it
batch a.csv --workers 0 --threads 0 -o out => a whole number; --threads is 0; 1 or more is expected
batch --images *.png -o out => give --verb VERB, one of view, remove, depth
batch jobs.csv => --output is missing
batch -o out => 0 lists, --images None and --data None; one list of jobs
batch jobs.csv --images *.png -o out => 1 lists, --images *.png
batch nothing.csv -o out => nothing.csv: cannot be read: no such file or directory
batch jobs.csv -o out --gpus-per-worker 1 => --gpus-per-worker is 1.0 without --ray
batch jobs.csv -o out --depths x => --depths and --masks go with --images
batch report => batch report is given 0 folders; one is expected
batch report nowhere => nowhere: holds no results of `dlama batch`
view image.png depth.png --fov 60 -o out => no camera move is given: give --yaw DEG
view image.png depth.png --fov 60 --yaw 3 --to target.json -o out => --to TARGET.json and --yaw contradict each other
view image.png depth.png --yaw 5 --fx -3 -o out => --fx is -3.0; K is singular or negative, at least 0.001 px is expected
view image.png depth.png --yaw 5 --fov 60 --fx 3 -o out => --fov and --fx contradict each other
view image.png depth.png --yaw 5 --fov 60 --far 0.5 -o out => no depth is nearer than --far, 0.5 m; the scene has 2 to 4 m
view image.png depth.png --yaw 5 --fov 60 --seed 99999999999 -o out => --seed is 99999999999
view image.png depth.png --yaw 5 --fx 1e-200 -o out => fx is 1e-200
view image.png depth.png --yaw 5 --fx 1e300 -o out => fx is 1e+300
view image.png depth.png --yaw 5 --fx 50 --cx 1e300 -o out => cx is 1e+300
view image.png depth.png --yaw 5 --fov 1e-12 -o out => no lens is as narrow
view image.png depth.png --yaw 5 --fov 60 --dolly 1e300 -o out => --dolly is 1e+300
view image.png depth.png --yaw 5 --fov 60 --pivot 1e300 -o out => --pivot is 1e+300
remove image.png depth.png mask.png --fov 60 --dilate=5000 -o out => --dilate is 5000
remove image.png depth.png mask.png --fov 60 --dilate=1000000000000 -o out => --dilate is 1000000000000
remove image.png depth.png mask.png --fov 60 --mask-class=256,0,0 -o out => --mask-class is 256,0,0; R,G,B of 0 to 255 each
remove image.png depth.png mask.png --fov 60 --mask-class=-1,0,0 -o out => --mask-class is -1,0,0; R,G,B of 0 to 255 each
remove image.png mask.png mask.png mask.png -o out => 3 files follow
view image.png depth.png --fov 60 --depth-model tcmonodepth --yaw 5 -o out => --depth-model and a depth file contradict each other
view image.png depth.png --fov 60 --metres-at 3,4=2 --yaw 5 -o out => --metres-at and a depth file contradict each other
view image.png depth.png --fov 60 --camera-height 2 --yaw 5 -o out => --camera-height and a depth file contradict each other
view image.png depth.png --fov 60 --no-sharpen --yaw 5 -o out => --no-sharpen and a depth file contradict each other
view image.png --depth-scale 1000 --yaw 5 -o out => --depth-scale is given without a depth file
view image.png --resize-depth nearest --yaw 5 -o out => --resize-depth is given without a depth file
view image.png --metres-at 3,4 --yaw 5 -o out => --metres-at is '3,4'; X,Y=D is expected
view image.png --metres-at 3,4=2 --camera-height 2 --yaw 5 -o out => --metres-at and --camera-height contradict each other
view image.png --depth-model midas --yaw 5 -o out => --depth-model is 'midas'; one of tcmonodepth,
view a.png --yaw 1 -o "" => -o is empty; a value is expected
view a.png --yaw 1 -o out --camera "" => --camera is empty; a value is expected
sequence . --masks none -o out => --masks is none; a folder of masks
sequence . --masks empty -o out => --masks is empty, which holds no picture
mask image.png -o found.png => no object is pointed at: give --click X,Y on it, --box X,Y,W,H round it
mask image.png --not 3,3 -o found.png => --click and --box are both missing
remove image.png -o out => no object to remove is given
remove image.png depth.png -o out => the mask not given, or
remove image.png mask.png depth.png -o out => or given before it?
remove image.png depth.png mask.png --mask mask.png -o out => the mask is given twice
remove image.png depth.png --mask mask.png --click 30,25 -o out => and clicks or a box were both given
remove image.png depth.png mask.png --candidate part -o out => --candidate is for clicks and boxes, and a mask file
remove image.png depth.png --salient --masker segment-anything -o out => --masker segment-anything contradict each other
"""
"""What is typed (an unset variable of a shell is "": `-o ""` wrote into the working directory), and what the line says."""


@pytest.mark.parametrize("row", WRONG.strip().splitlines())
def test_one_line_says_what_is_wrong(
    frame: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], row: str
) -> None:
    """Nothing is left behind, and nothing warned of before."""
    (frame / "jobs.csv").write_text("id,verb,image,yaw\na,view,image.png,5\n")
    (frame / "empty").mkdir()
    monkeypatch.chdir(frame)
    before = sorted(frame.rglob("*"))
    words, message = row.split(" => ")
    assert message in error_line(capsys, *shlex.split(words))
    assert sorted(frame.rglob("*")) == before


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


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_no_file(frame: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It was called empty; reading it would wait for ever, and /dev/zero would never end."""
    os.mkfifo(frame / "pipe.png")
    for words in ((frame / "pipe.png", "depth.png", "--fov", 60), ("image.png", "depth.png", "--camera", "/dev/zero")):
        reported = refused(capsys, frame, "view", *words, "--yaw", 5)
        assert "is a pipe or device, a file on disk is expected" in reported


def test_two_masks_of_one_frame_are_refused(tmp_path: Path) -> None:
    """The last one by name was taken without a word (oracle: the files). Hidden ones, as macOS leaves them, are none."""
    (tmp_path / "._b.png").touch()
    (tmp_path / "a.npy").touch()
    assert mask_files((), tmp_path) == {"a": tmp_path / "a.npy"}
    (tmp_path / "b.png").touch()  # next to pictures arrays may be what they were made of
    assert mask_files((), tmp_path) == {"b": tmp_path / "b.png"}
    for name in ("a.jpg", "a.png"):
        (tmp_path / name).touch()
    with pytest.raises(InputError, match=r"frame a has two, .*a\.jpg and a\.png"):
        mask_files((), tmp_path)


def test_black_masks_among_others_are_passed_over(tmp_path: Path) -> None:
    """As a segmenter of videos writes them where the object is out of view, also of labels; all of them black, or 1 for 255, are
    refused."""
    mask = np.zeros((4, 6), np.uint8)
    files = {name: tmp_path / f"{name}.png" for name in ("black", "marked")}
    Image.fromarray(mask).save(files["black"])
    mask[1, 2] = 255
    Image.fromarray(mask).save(files["marked"])
    assert [name for name, found in read_masks(files).items() if found.any()] == ["marked"]
    assert list(read_masks(files, mask_class="255,255,255")) == ["marked"]
    with pytest.raises(MaskError, match=r"no pixel shows class 9,9,9"):
        read_masks(files, mask_class="9,9,9")
    with pytest.raises(MaskError, match=r"black.png: the mask is empty"):
        read_masks({"black": files["black"]})
    Image.fromarray(mask // 255).save(files["black"])
    with pytest.raises(
        MaskError, match=r"its largest value is 1 of 255; 255 means remove.*`?mask_class=1,1,1`? removes one"
    ):
        read_masks(files)
    np.testing.assert_array_equal(read_mask(files["black"], mask_class="1,1,1"), mask > 0)
    Image.fromarray(mask // 15).save(files["black"])  # label 17
    with pytest.raises(MaskError, match=r"values 17.*mask_class=17,17,17`? removes one"):
        read_masks(files)
