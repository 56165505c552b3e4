"""Frames with and without an object, and stereo pairs, from folders: what goes in is what the files show."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from toy_runs import samples_of

from dlama.datasets.frames import Case, RemovalTruth, StereoTruth
from dlama.datasets.layouts import open_dataset
from dlama.errors import InputError
from dlama.geometry.camera import Camera, StereoRig
from dlama.geometry.holes import dilate_mask
from dlama.geometry.motion.trajectories import move_sideways
from dlama.geometry.rgbd import RGBD
from dlama.training.data import crops
from dlama.training.data.batches import check_sample
from dlama.training.data.cases import frames_of, scene_of, split_cases
from dlama.training.data.samples.dataset import case_pair, case_removal
from dlama.training.data.samples.views import PairExample, Samples, ViewExample, pair_sample, view_sample
from dlama.training.data.sources import Mixture, find_training_data, source_for
from dlama.training.settings import DataSettings, NetworkSettings
from dlama.worlds.writer import write_worlds

SIZE = 64
GREY, RED = 120, (200, 30, 30)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three scenes in EasySynth's layout, with and without their object, each with a stereo pair."""
    root = tmp_path_factory.mktemp("cases") / "made"
    write_worlds(root, count=3, size=SIZE)
    return root


@pytest.fixture
def whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples show whole frames, pixel by pixel."""
    monkeypatch.setattr(crops, "SMALLEST_CROP", 1.0)


def levels(planes: np.ndarray) -> np.ndarray:
    """3 x H x W of 0..1 as H x W x 3 of 0..255."""
    return np.rint(planes * 255).astype(np.uint8).transpose(1, 2, 0)


@pytest.mark.slow
@pytest.mark.usefixtures("whole")
def test_removals_show_what_the_files_show(folder: Path) -> None:
    """Oracle: the data set's own cases. The hole is the mask grown by 1 to 4 px; in it the truth is the frame without the
    object, in colour and depth; elsewhere input and truth are the frame with it."""
    source = source_for(samples_of("rgbd", cases=1.0, removal=1), [folder], "train")
    assert isinstance(source, Samples)
    cases = {f"made/{case.scene}/{case.frame}": case for case in open_dataset(folder).of("ori")}
    shown, third = 0, list(enumerate(source.example.args[0]))[::3]
    for index, case in third:
        truth = cases[f"{scene_of(case)}/{case.frame}"].load()
        assert isinstance(truth, RemovalTruth)
        example = source.example(index, np.random.default_rng(index))
        assert isinstance(example, ViewExample)
        hole = example.view.hole
        if not any(np.array_equal(hole, dilate_mask(truth.mask, radius)) for radius in (1, 2, 3, 4)):
            continue  # too small an object: a random mask instead
        shown += 1
        made = view_sample(example, source.network)
        assert np.array_equal(levels(made["target"][:3])[hole], truth.without.color[hole])
        assert np.array_equal(example.truth.depth[hole], truth.without.depth[hole])
        assert np.array_equal(levels(made["input"][:3])[~hole], truth.source.color[~hole])
        assert np.array_equal(levels(made["target"][:3])[~hole], truth.source.color[~hole])
        assert np.array_equal(example.truth.depth[~hole], truth.source.depth[~hole])
        assert np.array_equal(made["mask"][0] > 0, hole) and not made["input"][:4, hole].any()
        there = truth.source.depth[truth.mask]
        assert np.array_equal(example.law.measured[0][1][truth.mask], there)  # what was removed still limits
    assert shown > 0.8 * len(third) > 5


@pytest.mark.usefixtures("whole")
@pytest.mark.parametrize("planes", ["stereo", "stereo-two-masks"])
def test_pairs_show_what_the_files_show(folder: Path, planes: str) -> None:
    """Oracle: the data set's own cases, as for removals; one radius for both masks; one mask plane is their union."""
    source = source_for(samples_of(planes, cases=1.0, stereo=1), [folder], "train")
    assert isinstance(source, Samples)
    cases = {f"made/{case.scene}": case for case in open_dataset(folder).of("sii")}
    for index, case in enumerate(source.example.args[0]):
        truth = cases[scene_of(case)].load()
        example = source.example(index, np.random.default_rng(index))
        assert isinstance(example, PairExample)
        made = pair_sample(example, source.network)
        grown = [np.stack([dilate_mask(mask, r) for mask in (truth.mask_left, truth.mask_right)]) for r in (1, 2, 3, 4)]
        found = [holes for holes in grown if np.array_equal(made["mask"] > 0, holes if "two" in planes else
                                                            holes.any(0, keepdims=True))]  # fmt: skip
        assert len(found) == 1
        ends = (truth.left, truth.without_left.color), (truth.right, truth.without_right.color)
        for side, (shown, without) in enumerate(ends):
            true, given = levels(made["target"][3 * side :][:3]), levels(made["input"][3 * side :][:3])
            own = found[0][side]
            assert np.array_equal(true[own], without[own]) and np.array_equal(true[~own], shown[~own])
            known = made["mask"][side if "two" in planes else 0] == 0
            assert np.array_equal(given[known], shown[known]) and not given[~known].any()


def box_before_a_wall(**more: object) -> RemovalTruth:
    """A red box, 1 m away, before a grey wall at 3 m; the mask is the box to the pixel."""
    camera = Camera(120, 90, 80.0, 80.0, 60.0, 45.0)
    mask = np.zeros(camera.hw, bool)
    mask[30:52, 41:67] = True
    wall = np.full((*camera.hw, 3), GREY, np.uint8)
    color, depth = wall.copy(), np.full(camera.hw, 3.0, np.float32)
    color[mask] = RED
    depth[mask] = 1.0
    without = RGBD(wall, np.full(camera.hw, 3.0, np.float32), camera)
    return RemovalTruth(RGBD(color, depth, camera), without, mask, **more)  # type: ignore[arg-type]


def removal_of(truth: RemovalTruth, size: int, seed: int) -> ViewExample:
    """An example of this case."""
    case = Case("ori", "made", "s", "with", lambda: truth)
    return case_removal([case], size, 0, np.random.default_rng(seed))


@pytest.mark.parametrize("size", [32, 48, 96])
def test_nothing_of_the_object_is_left_at_any_scale(size: int) -> None:
    """Closed form: a grey wall is all there is to see and to learn, however the square is drawn, shrunk or enlarged."""
    for seed in range(12):
        example = removal_of(box_before_a_wall(), size, seed)
        assert (example.view.color[~example.view.hole] == GREY).all() and example.view.hole.any()
        assert (example.truth.color == GREY).all() and np.allclose(example.truth.depth, 3)


def test_other_light_without_the_object_is_brought_back() -> None:
    """Closed form: the frame without the object at half the exposure; its wall is as bright as that of the frame with it."""
    truth = box_before_a_wall(exposure_varies=True)
    dark = replace(truth.without, color=(truth.without.color // 2).astype(np.uint8))
    example = removal_of(replace(truth, without=dark), 48, 0)
    assert np.abs(example.truth.color.astype(int) - GREY).max() <= 1


def test_no_hole_where_the_background_is_not_the_same() -> None:
    """Law: the hole stays in `compare`, whatever the mask says."""
    truth = box_before_a_wall()
    compare = np.zeros_like(truth.mask)
    compare[:, :54] = True  # half of the box
    marked = np.where(
        compare[..., None], truth.without.color, np.uint8([1, 2, 3])
    )  # other objects where it is not compared
    truth = replace(truth, compare=compare, without=replace(truth.without, color=marked))
    for seed in range(8):
        example = removal_of(truth, 48, seed)
        assert not (example.truth.color == (1, 2, 3)).all(-1).any()


def test_pairs_without_an_object_get_one_hole_on_one_surface() -> None:
    """Closed form: a wall whose disparity is 8 px; the right hole is the left one moved, and the truth is the pictures."""
    rng = np.random.default_rng(0)
    wall = rng.integers(0, 255, (80, 100, 3), np.uint8)
    rig = StereoRig(Camera.from_fov(100, 80, 60), move_sideways(Camera.from_fov(100, 80, 60), 0.1))
    pair = StereoTruth(wall, np.roll(wall, -8, 1), rig, np.full((80, 100), 8, np.float32))
    case = Case("sii", "made", "s", "p", lambda: pair)
    for seed in range(6):
        example = case_pair([case], 80, 0, np.random.default_rng(seed))
        made = pair_sample(example, NetworkSettings("stereo-two-masks"))
        side = 80 / crops.random_crop((80, 100), 80, np.random.default_rng(seed)).side  # the same square again
        left, right = made["mask"] > 0
        moved = np.zeros_like(left)
        moved[:, : -round(8 * side)] = left[:, round(8 * side) :]
        assert (moved != right).mean() < 0.03 and left.any()
        known = np.broadcast_to(made["mask"].repeat(3, 0) == 0, made["target"].shape)
        assert np.array_equal(made["input"][:6][known], made["target"][known])
        assert made["target"][:, left].std() > 0.1  # the surface itself is the truth


def test_stereo_folders_and_removal_folders_are_read(data_dir: Path) -> None:
    """Real ones, in both layouts that are no EasySynth: check_sample agrees."""
    pairs = find_training_data(data_dir / "data" / "stereo").cases
    assert len(pairs) == 2 and {case.protocol for case in pairs} == {"sii"}
    rng, net = np.random.default_rng(0), NetworkSettings("stereo")
    check_sample(pair_sample(case_pair(pairs, 64, 0, rng), net), net, 64)
    removals = find_training_data(data_dir / "data" / "bin_removal").cases
    net = NetworkSettings("rgbd")
    check_sample(view_sample(case_removal(removals, 64, 0, rng), net), net, 64)


def test_worlds_take_their_share(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Half of a kind's samples are the data's unless `data.cases` says otherwise, and the log says so; without cases all
    are of worlds."""
    assert DataSettings().cases == 0.5
    for kind, planes in (("removal", "rgbd"), ("stereo", "stereo")):
        with caplog.at_level(logging.INFO, "dlama"):
            source = source_for(samples_of(planes, cases=0.25, **{kind: 1.0}), [folder], "train")
        assert isinstance(source, Mixture) and source.kinds == ("cases", "worlds")
        assert source.thresholds.tolist() == [0.25, 1.0]
        assert f"25% of kind '{kind}' are made of them, 75% of worlds" in caplog.text
        assert not isinstance(source_for(samples_of(planes, cases=0.25, **{kind: 1.0}), [], "train"), Mixture)
        for index in range(4):
            check_sample(source.sample(index, np.random.default_rng(index)), NetworkSettings(planes), SIZE)  # type: ignore
    with pytest.raises(InputError, match="cases is 0"):
        DataSettings(cases=0)


def test_a_scene_is_held_out_of_all_kinds_at_once(folder: Path) -> None:
    """No scene is on both sides, whichever kinds its cases are of, and each kind is on both."""
    found = find_training_data(folder)
    cases = {split: split_cases(found.cases, split) for split in ("train", "held_out")}
    scenes = {split: {scene_of(case) for case in own} for split, own in cases.items()}
    assert not scenes["train"] & scenes["held_out"] and len(found.cases) == sum(map(len, cases.values()))
    for own in cases.values():
        assert {case.protocol for case in own} == {"vpi", "ori", "sii"}
    alone = [case for case in found.cases if case.protocol == "vpi" or (case.protocol, case.scene) == ("ori", "w000")]
    with pytest.raises(InputError, match="scenes with removals: two or more"):
        split_cases(alone, "train")


def test_one_scene_is_split_by_frames(folder: Path) -> None:
    """A frame that is held out as a removal is trained on as nothing else."""
    cases = find_training_data(folder / "w000").cases
    cases = tuple(case for case in cases if case.protocol != "sii")
    train, held = split_cases(cases, "train"), split_cases(cases, "held_out")
    frames = [{frame for case in own for frame in frames_of(case)} for own in (train, held)]
    assert not frames[0] & frames[1] and {case.protocol for case in held} == {"vpi", "ori"}
