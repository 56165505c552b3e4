"""Photos as samples: crops, masks from moved cameras, and which of them are held out."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dlama.errors import FileError, InputError
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.training.data.batches import check_sample
from dlama.training.data.photos import Photo, folder_photos, read_photo, split_photos, square_crop
from dlama.training.data.samples.photos import PhotoSamples, WarpedPhotoSamples, hole_of_world, unseen_by_camera
from dlama.training.data.sources import find_training_data
from dlama.training.settings import NetworkSettings

RGB = NetworkSettings("rgb")


def ramp(seed: int, hw: tuple[int, int] = (80, 120)) -> np.ndarray:
    """A picture that tells where each pixel is from."""
    v, u = np.mgrid[: hw[0], : hw[1]]
    return np.stack([u, v, np.full(hw, seed)], -1).astype(np.uint8)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Six pictures in two folders, one of them grey."""
    for number in range(6):
        path = tmp_path / ("a" if number < 3 else "b") / f"p{number}.png"
        path.parent.mkdir(exist_ok=True)
        Image.fromarray(ramp(number) if number else ramp(number)[..., 0]).save(path)
    return tmp_path


def test_known_pixels_are_the_photo_under_one_light(folder: Path) -> None:
    """Where input is known it is the target, and check_sample agrees; the same state of the generator gives the same."""
    source = PhotoSamples(folder_photos(folder), RGB, 64)
    for index in range(len(source)):
        made, again = (source.sample(index, np.random.default_rng([7, index])) for _ in range(2))
        check_sample(made, RGB, 64)
        known = np.broadcast_to(made["mask"] == 0, made["target"].shape)
        assert np.array_equal(made["input"][:3][known], made["target"][known])
        assert all(np.array_equal(made[key], again[key]) for key in made)


def test_crops_are_squares_of_the_picture() -> None:
    """Oracle: the ramp, whose levels are pixel coordinates: both axes have one scale, and all lies within."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        crop = square_crop(ramp(3), 40, rng).astype(float)
        across, down = np.diff(crop[20, 5:35, 0]).mean(), np.diff(crop[5:35, 20, 1]).mean()
        assert abs(across - down) < 0.05 and 1 <= round(across, 2) <= 2.01
        assert crop[..., 0].max() < 120 and crop[..., 1].max() < 80
    assert square_crop(ramp(1, (20, 30)), 64, rng).shape == (64, 64, 3)


def test_there_and_back_loses_what_a_near_wall_hides() -> None:
    """Closed form: a camera moved right by t sees fx t (1/near - 1/far) columns less to the left of a near strip,
    and what its picture's border cuts off: fx t / z columns at the left."""
    camera = Camera(64, 48, 60.0, 60.0, 32.0, 24.0)
    depth = np.full(camera.hw, 4.0, np.float32)
    depth[:, 30:40] = 1.5
    color = np.zeros((*camera.hw, 3), np.uint8)
    pose = np.eye(4)
    pose[0, 3] = 0.2
    lost = unseen_by_camera(RGBD(color, depth, camera), camera.at(pose))[10:40]
    gap, cut = 60 * 0.2 * (1 / 1.5 - 1 / 4), 60 * 0.2 / 4
    assert abs(lost[:, cut.__ceil__() + 2 : 40].sum(1).mean() - gap) <= 2
    assert abs(lost[:, :8].sum(1).mean() - cut) <= 1 and not lost[:, 41:].any()


def test_photos_under_holes_of_worlds(folder: Path) -> None:
    """check_sample agrees, and the same generator gives the same hole in a bank made anew."""
    from dlama.training.data.samples import photos as photo_samples

    source = WarpedPhotoSamples(folder_photos(folder), RGB, 64, functools.partial(_first_worlds, split="train"))
    made = [source.sample(1, np.random.default_rng(8)) for _ in range(2)]
    check_sample(made[0], RGB, 64)
    photo_samples._holes_of_world.cache_clear()
    assert np.array_equal(made[1]["mask"], source.sample(1, np.random.default_rng(8))["mask"])


def _first_worlds(rng: np.random.Generator, size: int, split: str) -> np.ndarray:
    """The shapes of one world, since each costs a tenth of a second."""
    rng.integers(2)
    return hole_of_world(np.random.default_rng(11), size, split)


def test_splits_share_no_photo_and_keep_videos_together() -> None:
    """Every photo is in one split; the frames of one video, which look alike, are on one side."""
    names = [f"n{i}_dog" for i in range(80)] + [f"{video}_{i:06d}" for video in ("A1", "B2") for i in range(20)]
    photos = [Photo(name, functools.partial(ramp, 0)) for name in names]
    train, held = ({photo.name for photo in split_photos(photos, split)} for split in ("train", "held_out"))
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
    assert len(find_training_data([tmp_path / "it may be photos"]).photos) == 2


def test_what_cannot_be_learned_from(tmp_path: Path) -> None:
    """Photos without depth for a network of depth; an empty folder; a picture that is none."""
    photo = Photo("a", functools.partial(ramp, 0))
    for planes in ("rgbd", "stereo"):
        with pytest.raises(InputError, match="photos have no depth"):
            PhotoSamples((photo,), NetworkSettings(planes), 64)
    with pytest.raises(FileError, match="holds no picture"):
        folder_photos(tmp_path)
    (tmp_path / "x.png").write_bytes(b"no picture")
    with pytest.raises(FileError, match=r"x\.png"):
        read_photo(tmp_path / "x.png")
