"""Photos that are textures: which pictures are read, crops of them, and which of them are held out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dlama.errors import FileError, InputError
from dlama.training.data.photos import read_photo, split_photos, square_crop
from dlama.training.data.sources import find_training_data


def ramp(seed: int, hw: tuple[int, int] = (80, 120)) -> np.ndarray:
    """A picture that tells where each pixel is from."""
    v, u = np.mgrid[: hw[0], : hw[1]]
    return np.stack([u, v, np.full(hw, seed)], -1).astype(np.uint8)


def test_crops_are_squares_of_the_picture() -> None:
    """Oracle: the ramp, whose levels are pixel coordinates: both axes have one scale, and all lies within."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        crop = square_crop(ramp(3), 40, rng).astype(float)
        across, down = np.diff(crop[20, 5:35, 0]).mean(), np.diff(crop[5:35, 20, 1]).mean()
        assert abs(across - down) < 0.05 and 1 <= round(across, 2) <= 2.01
        assert crop[..., 0].max() < 120 and crop[..., 1].max() < 80
    assert square_crop(ramp(1, (20, 30)), 64, rng).shape == (64, 64, 3)


def test_splits_share_no_photo_and_keep_videos_together() -> None:
    """Every photo is in one split; the frames of one video, which look alike, are on one side."""
    names = [f"n{i}_dog" for i in range(80)] + [f"{video}_{i:06d}" for video in ("A1", "B2") for i in range(20)]
    photos = [Path(f"{name}.png") for name in names]
    train, held = ({photo.stem for photo in split_photos(photos, split)} for split in ("train", "held_out"))
    assert train | held == set(names) and not train & held and 0 < len(held) < 50
    for video in ("A1", "B2"):
        assert len({name in held for name in names if name.startswith(video)}) == 1
    one = split_photos(photos[:2], "train"), split_photos(photos[:2], "held_out")
    assert len(one[0]) == len(one[1]) == 1
    with pytest.raises(InputError, match="two or more"):
        split_photos(photos[:1], "train")


def test_a_folder_whose_name_says_may_be(tmp_path: Path) -> None:
    """Law: what a folder holds says whether it is a data set, not the words of its path."""
    (tmp_path / "it may be photos").mkdir()
    for name in "ab":
        Image.fromarray(ramp(1)).save(tmp_path / "it may be photos" / f"{name}.png")
    assert len(find_training_data(tmp_path / "it may be photos").photos) == 2


def test_what_cannot_be_learned_from(tmp_path: Path) -> None:
    """A picture that is none."""
    (tmp_path / "x.png").write_bytes(b"no picture")
    with pytest.raises(FileError, match=r"x\.png"):
        read_photo(tmp_path / "x.png")
