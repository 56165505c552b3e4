"""Videos (oracles: what Pillow and PyAV read back, the pictures that went in)."""

from __future__ import annotations

import sys
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from dlama.errors import InputError, MissingExtraError, ShapeError
from dlama.files.results.video import write_video

PICTURES = [np.full((33, 46, 3), (10 * n, 200 - 10 * n, 90), np.uint8) for n in range(8)]


@pytest.mark.parametrize("name", ["a.webp", "a.gif"])
def test_animations_hold_every_picture(tmp_path: Path, name: str) -> None:
    """Count, size and duration, and colours within a few levels."""
    assert write_video(tmp_path / name, PICTURES, 10) == 8
    with Image.open(tmp_path / name) as found:
        assert found.n_frames == 8 and found.size == (46, 33)  # type: ignore[attr-defined]
        for number, picture in enumerate(PICTURES):
            found.seek(number)
            assert np.abs(np.array(found.convert("RGB")).astype(int) - picture).mean() < 4


@pytest.mark.parametrize(("name", "fps", "seconds"), [("a.gif", 30, 0.27), ("a.gif", 24, 0.33), ("a.webp", 60, 0.133)])
def test_animations_last_as_long_as_their_pictures(tmp_path: Path, name: str, fps: float, seconds: float) -> None:
    """Closed form: eight pictures at so many a second, to the step of the format. GIFs were up to 40 % too fast."""
    write_video(tmp_path / name, PICTURES, fps)
    with Image.open(tmp_path / name) as found:
        durations = []
        for number in range(8):
            found.seek(number)
            found.load()
            durations.append(found.info["duration"])
    assert sum(durations) == round(1000 * seconds)


def test_a_video_holds_every_picture(tmp_path: Path) -> None:
    """Read back by PyAV: count, rate, even size, colours within a few levels."""
    assert write_video(tmp_path / "a.mp4", PICTURES, 12.5) == 8
    with av.open(str(tmp_path / "a.mp4")) as found:
        assert float(found.streams.video[0].average_rate) == 12.5
        frames = [frame.to_ndarray(format="rgb24") for frame in found.decode(video=0)]
    assert len(frames) == 8 and frames[0].shape == (32, 46, 3)
    assert all(np.abs(frame.astype(int) - picture[:32]).mean() < 6 for frame, picture in zip(frames, PICTURES))


@pytest.mark.parametrize("name", ["a.mp4", "a.mkv"])
def test_colours_of_a_video_do_not_depend_on_a_guess(
    tmp_path: Path, name: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Oracle: ITU-R BT.709's red, 63 102 240; the file states it, where players take BT.601 or BT.709 by the size otherwise."""
    write_video(tmp_path / name, [np.full((32, 32, 3), (255, 0, 0), np.uint8)])
    with av.open(str(tmp_path / name)) as found:
        frame, stated = next(found.decode(video=0)), found.streams.video[0].codec_context
    assert np.abs([int(bytes(plane)[0]) for plane in frame.planes] - np.array([63, 102, 240])).max() <= 1
    assert (stated.color_primaries, stated.color_trc, stated.colorspace, stated.color_range) == (1, 13, 1, 1)
    assert not caplog.records  # an option that the container does not have


@pytest.mark.parametrize(
    ("name", "hw", "limits"),
    [("a.mp4", (1, 40), "2 to 16384"), ("a.mkv", (2, 16386), "2 to 16384"), ("a.webp", (16384, 2), "1 to 16383")],
)
def test_pictures_that_a_format_cannot_hold_are_refused(
    tmp_path: Path, name: str, hw: tuple[int, int], limits: str
) -> None:
    """Oracle: the limits of H.264 and of WebP, whose encoders ended in tracebacks; a line, and nothing is left."""
    with pytest.raises(InputError, match=f"are {hw[1]}x{hw[0]}; {Path(name).suffix} has sides of {limits} px"):
        write_video(tmp_path / name, [np.zeros((*hw, 3), np.uint8)])
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_a_video_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another ending, two sizes; and without PyAV a line with what to install."""
    with pytest.raises(InputError, match=r"output is a\.avi; a name that ends in \.mp4"):
        write_video("a.avi", PICTURES)
    with pytest.raises(InputError, match="fps is 60; a GIF has at most 50 pictures a second"):
        write_video(tmp_path / "a.gif", PICTURES, 60)
    with pytest.raises(ShapeError, match="one size is expected"):
        write_video(tmp_path / "a.gif", [PICTURES[0], PICTURES[0][1:]])
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'dlama\[video\]'"):
        write_video(tmp_path / "a.mp4", PICTURES)
    assert list(tmp_path.iterdir()) == []
