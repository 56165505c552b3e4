"""Sources: --data of every sort becomes the right one, and what is held out is not trained on."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from toy_runs import samples_of

from dlama.datasets.frames import Case, ViewTruth
from dlama.errors import InputError
from dlama.training.data.batches import check_sample
from dlama.training.data.cases import frames_of, split_cases
from dlama.training.data.sources import Mixture, source_for
from dlama.training.settings import NetworkSettings
from posed_folders import LENS, text_K, truth, write_numbered


def two_views(first: int, second: int) -> ViewTruth:
    """Two frames of a closed-form world."""
    frames = truth()
    return ViewTruth(frames[first], frames[second])


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """Four pictures of noise under a gradient, 96 x 120."""
    folder, rng = tmp_path / "photos", np.random.default_rng(0)
    folder.mkdir()
    v, u = np.mgrid[:96, :120]
    for number in range(4):
        smooth = np.stack([u + number, v + 2 * number, u + v], -1)
        Image.fromarray((smooth + rng.integers(0, 6, (96, 120, 3))).astype(np.uint8)).save(folder / f"f{number}.png")
    return folder


@pytest.fixture
def posed(tmp_path: Path) -> Path:
    """A data set of two scenes, four frames each."""
    for scene in ("one", "two"):
        root = write_numbered(tmp_path / "posed" / scene)
        (root / "camera-intrinsics.txt").write_text(text_K(LENS))
    return tmp_path / "posed"


def test_frames_of_a_pair(posed: Path) -> None:
    """check_sample agrees for every pair; the input's known pixels are those of the rendered view."""
    source = source_for(samples_of("rgbd", frame=1), [posed], "train")
    for index in range(len(source)):
        check_sample(source.sample(index, np.random.default_rng(index)), NetworkSettings("rgbd"), 64)


def test_pairs_are_split_by_scene_or_by_frame() -> None:
    """No frame is on both sides, in several scenes or in one; a chain of frames that all hang together is refused."""

    def pair(scene: str, one: int, two: int) -> Case:
        return Case("vpi", "made", scene, f"{one}_to_{two}", functools.partial(two_views, 0, 1))

    for pairs in ([pair(f"s{i // 4}", i, i + 1) for i in range(40)], [pair("s", i, i + 1) for i in range(0, 40, 2)]):
        train, held = split_cases(pairs, "train"), split_cases(pairs, "held_out")
        seen = [{(each.scene, frame) for each in part for frame in frames_of(each)} for part in (train, held)]
        assert train and held and not seen[0] & seen[1]
    with pytest.raises(InputError, match="share frames"):
        split_cases([pair("s", 0, i) for i in range(1, 6)], "train")


def test_mixtures_draw_by_share() -> None:
    """How often each kind is drawn (oracle: its share, within four standard deviations); the same state, the same kind."""

    class Says:
        def __init__(self, word: int, count: int) -> None:
            self.word, self.count = word, count

        def __len__(self) -> int:
            return self.count

        def sample(self, index: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
            assert index < self.count
            return {"word": np.array(self.word)}

    mixture = Mixture({"a": (Says(0, 3), 1.0), "b": (Says(1, 50), 3.0)})
    assert len(mixture) == 50
    words = [int(mixture.sample(n % 50, np.random.default_rng([1, n]))["word"]) for n in range(1200)]
    assert abs(np.mean(words) - 0.75) < 4 * np.sqrt(0.75 * 0.25 / 1200)
    assert words == [int(mixture.sample(n % 50, np.random.default_rng([1, n]))["word"]) for n in range(1200)]


def test_what_source_for_refuses(photos: Path, posed: Path, tmp_path: Path) -> None:
    """Kinds without their files, files without a kind, folders with nothing in them: each says what is expected."""
    (tmp_path / "empty").mkdir()
    for chosen, data, words in (
        (samples_of("rgbd", frame=1), [photos], "needs a posed data set"),
        (samples_of("rgbd", world=1), [posed], "no use for .*posed.*; a mixture with frame is expected"),
        (samples_of("rgbd", world=1), [photos, posed], "no use for .*posed"),  # what is named is used, each folder
        (samples_of("rgbd", frame=1), [posed, photos], "no use for .*photos.*world or removal or stereo is expected"),
        (samples_of("rgbd", world=1), [tmp_path / "empty"], "holds no picture"),
        (samples_of("rgbd", world=1), [tmp_path / "gone"], "no such folder"),
    ):
        with pytest.raises(InputError, match=words):
            source_for(chosen, data, "train")


def test_real_pairs_make_samples(data_dir: Path) -> None:
    """A Kinect's frames: check_sample agrees, and no target depth is a gap."""
    source = source_for(samples_of("rgbd", frame=1), [data_dir / "data" / "kitchen_vpi"], "train")
    made = source.sample(0, np.random.default_rng(1))
    check_sample(made, NetworkSettings("rgbd"), 64)
    assert 0 < made["known_depth"].mean() < 1 and made["target"][3].min() > 0.05
