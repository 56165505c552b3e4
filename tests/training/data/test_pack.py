"""Packs and sources: what goes in comes out, within the stated size; and --data of every sort becomes the right source."""

from __future__ import annotations

import functools
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dlama.datasets.frames import ViewTruth
from dlama.errors import FileError, InputError, OutputError
from dlama.training.data.batches import check_sample
from dlama.training.data.cases import TrainingCase, split_cases
from dlama.training.data.crops import resize_frame
from dlama.training.data.pack import pack
from dlama.training.data.pack_format import read_pack
from dlama.training.data.sources import Mixture, find_training_data, source_for
from dlama.training.settings import DataSettings, NetworkSettings, TrainSettings
from posed_folders import truth


def settings(planes: str, size: int = 64, **mixture: float) -> TrainSettings:
    """With shares by kind."""
    return TrainSettings("t", network=NetworkSettings(planes), data=DataSettings(size=size, mixture=mixture))


def two_views(first: int, second: int) -> ViewTruth:
    """Two frames of a closed-form world."""
    frames = truth()
    return ViewTruth(frames[first], frames[second])


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """Forty pictures of noise under a gradient, 96 x 120."""
    folder, rng = tmp_path / "photos", np.random.default_rng(0)
    folder.mkdir()
    v, u = np.mgrid[:96, :120]
    for number in range(40):
        smooth = np.stack([u + number, v + 2 * number, u + v], -1)
        Image.fromarray((smooth + rng.integers(0, 6, (96, 120, 3))).astype(np.uint8)).save(folder / f"f{number}.png")
    return folder


@pytest.fixture
def posed(tmp_path: Path) -> Path:
    """A data set of two scenes, four frames each."""
    return write_scannet(tmp_path / "posed")


def write_scannet(folder: Path) -> Path:
    """The closed-form world of posed_folders in ScanNet's layout, twice."""
    from dlama.files.rasters.depth import write_depth_png
    from dlama.files.rasters.pictures import write_color

    for scene in ("one", "two"):
        root = folder / scene
        (root / "color").mkdir(parents=True)
        for name in ("depth", "pose", "intrinsic"):
            (root / name).mkdir()
        K = np.eye(4)
        for number, rgbd in enumerate(truth()):
            write_color(root / "color" / f"{number}.jpg", rgbd.color)
            write_depth_png(root / "depth" / f"{number}.png", rgbd.depth)
            np.savetxt(root / "pose" / f"{number}.txt", rgbd.camera.world_from_cam)
            K[:3, :3] = rgbd.camera.K
        for name in ("intrinsic_color.txt", "intrinsic_depth.txt"):
            np.savetxt(root / "intrinsic" / name, K)
    return folder


def test_photos_and_pairs_come_back(photos: Path, posed: Path, tmp_path: Path) -> None:
    """Photos within what WebP loses, depth within half a millimetre, cameras and names to the digit."""
    lines = pack([photos, posed], tmp_path / "a.pack", megabytes=5, size=64)
    read_photos, read_pairs = read_pack(tmp_path / "a.pack")
    given = find_training_data([photos, posed])
    assert len(read_photos) == 40 and len(read_pairs) == len(given.cases) > 2 and "40 of 40" in lines[1]
    originals = {photo.name: photo.load() for photo in given.photos}
    for photo in read_photos[:5]:
        shrunk = originals[photo.name].reshape(96, 120, 3)[::3, ::3]
        back = photo.load()
        assert back.shape == (64, 80, 3)
        assert np.abs(back[::2, ::2].astype(float) - shrunk).mean() < 8
    named = {pair.name + pair.scene: pair for pair in given.cases}
    for pair in read_pairs:
        was, now = named[pair.name + pair.scene].load(), pair.load()
        assert pair.frames == named[pair.name + pair.scene].frames and pair.kind == "frame"
        for end in ("source", "target"):
            small = resize_frame(getattr(was, end), 64 / 72)
            back = getattr(now, end)
            assert np.array_equal(back.camera.world_from_cam, small.camera.world_from_cam)
            assert back.camera.same_lens_as(small.camera)
            assert np.abs(back.depth - small.depth)[small.valid].max() <= 0.00051
            assert np.array_equal(back.missing, small.missing)
            assert np.abs(back.color.astype(float) - small.color).mean() < 5


def test_depth_codes_of_packs_stay() -> None:
    """Oracle: the codes that packs have had from the first: float32 steps of 1 mm, 0 = missing, 65535 = far, 1 to 65534 else."""
    import cv2

    from dlama.training.data.pack_format import depth_png

    depth = np.float32([[0, np.inf, 0.0003, 1.2344, 65.5341, 900.0], [*np.random.default_rng(0).uniform(0.2, 60, 6)]])
    codes = cv2.imdecode(np.frombuffer(depth_png(depth), np.uint8), cv2.IMREAD_UNCHANGED)
    assert codes.dtype == np.uint16 and codes[0].tolist() == [0, 65535, 1, 1234, 65534, 65534]
    assert np.array_equal(codes[1], np.rint(depth[1] * np.float32(1000)))


def test_size_is_kept_and_bytes_repeat(photos: Path, tmp_path: Path) -> None:
    """The file is no larger than said and not much smaller where more was to be had; the same input, the same bytes."""
    for megabytes in (0.006, 0.014):
        one, same, other = (tmp_path / name for name in ("1.pack", "2.pack", "3.pack"))
        pack([photos], one, megabytes=megabytes, size=64)
        pack([photos], same, megabytes=megabytes, size=64)
        pack([photos], other, megabytes=megabytes, size=64, seed=1)
        assert 0.7 * megabytes * 1e6 < one.stat().st_size <= megabytes * 1e6
        assert one.read_bytes() == same.read_bytes() != other.read_bytes()


def test_a_pack_needs_no_other_file_and_keeps_the_split(photos: Path, tmp_path: Path) -> None:
    """With the folder gone, samples come from the pack; held-out photos are those of the folder; sources travel."""
    import shutil

    from dlama.training.data.photos import folder_photos, split_photos

    held = {photo.name for photo in split_photos(folder_photos(photos), "held_out")}
    pack([photos], tmp_path / "a.pack", megabytes=5, size=64)
    shutil.rmtree(photos)
    source = source_for(settings("rgb", world=1), [tmp_path / "a.pack"], "held_out")
    assert {photo.name for photo in source.example.args[0].photos} == held  # type: ignore[attr-defined]
    check_sample(source.sample(0, np.random.default_rng(0)), NetworkSettings("rgb"), 64)
    travelled = pickle.loads(pickle.dumps(source)).sample(0, np.random.default_rng(0))
    assert np.array_equal(travelled["input"], source.sample(0, np.random.default_rng(0))["input"])


def test_bad_packs(photos: Path, tmp_path: Path) -> None:
    """Not ours, cut off, or with a spoiled part: each named. A pack that cannot be written leaves the older one."""
    path = tmp_path / "a.pack"
    with pytest.raises(InputError, match="size is 15 px; 16 or more is expected"):
        pack([photos], path, megabytes=1, size=15)
    pack([photos], path, megabytes=1, size=64)
    whole = path.read_bytes()
    (tmp_path / "cut.pack").write_bytes(whole[:2000])
    with pytest.raises(FileError, match=r"cut\.pack: is no pack"):
        read_pack(tmp_path / "cut.pack")
    spoiled = bytearray(whole)
    at = whole.index(b"RIFF")
    spoiled[at : at + 40] = bytes(40)
    (tmp_path / "spoiled.pack").write_bytes(spoiled)
    with pytest.raises(FileError, match=r"photos/000000.webp: is damaged"):
        read_pack(tmp_path / "spoiled.pack")[0][0].load()
    large = bytearray(whole)
    large[at + 26 : at + 30] = b"\x40\x1f\x28\x23"  # width and height of a lossy WebP (RFC 9649), 14 bits each
    (tmp_path / "large.pack").write_bytes(large)
    with pytest.raises(FileError, match=r"photos/000000.webp: says it holds 8000x9000 pixels"):
        read_pack(tmp_path / "large.pack")[0][0].load()
    with zipfile.ZipFile(tmp_path / "bomb.pack", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("index.json", " " * 20_000_000)
    with pytest.raises(FileError, match=r"bomb\.pack: is no pack.*compressed"):
        read_pack(tmp_path / "bomb.pack")
    for index, told in (
        ("[" * 100_000, ""),
        ('{"format": "dlama pack", "version": 2, "photos": [], "takes": [{"kind": "frame", "parts": 3}]}', ""),
        ('{"format": "dlama pack", "version": 2, "photos": [], "takes": [{"kind": "film"}]}', ".*of kind 'film'"),
        ('{"format": "dlama pack", "version": 3, "photos": [], "takes": []}', ".*version 2"),
    ):
        with zipfile.ZipFile(tmp_path / "index.pack", "w") as archive:
            archive.writestr("index.json", index)
        with pytest.raises(FileError, match=rf"index\.pack: {told}"):
            read_pack(tmp_path / "index.pack")
    for wrong in ({"seed": -1}, {"seed": 2**32}, {"megabytes": float("nan")}, {"megabytes": -1}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            pack([photos], path, **wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="not one picture"):
        pack([photos], path, megabytes=0.0005)
    with pytest.raises(OutputError):
        pack([photos], tmp_path / "nowhere" / "a.pack", megabytes=1, size=64)
    assert path.read_bytes() == whole


def test_frames_of_a_pair(posed: Path) -> None:
    """check_sample agrees for every pair; the input's known pixels are those of the rendered view."""
    source = source_for(settings("rgbd", frame=1), [posed], "train")
    for index in range(len(source)):
        check_sample(source.sample(index, np.random.default_rng(index)), NetworkSettings("rgbd"), 64)


def test_scaling_keeps_points_in_place() -> None:
    """A point in the world falls on the same share of the picture before and after (oracle: the camera model)."""
    rgbd = truth()[1]
    small = resize_frame(rgbd, 0.5)
    assert small.camera.hw == (36, 48) and small.depth.shape == (36, 48)
    before = rgbd.camera.K @ (0.3, -0.2, 2.0)
    after = small.camera.K @ (0.3, -0.2, 2.0)
    assert np.allclose(before[:2] / before[2] / 2, after[:2] / after[2])


def test_pairs_are_split_by_scene_or_by_frame() -> None:
    """No frame is on both sides, in several scenes or in one; a chain of frames that all hang together is refused."""

    def pair(scene: str, one: int, two: int) -> TrainingCase:
        load = functools.partial(two_views, 0, 1)
        return TrainingCase("frame", scene, f"{one}_to_{two}", frozenset({str(one), str(two)}), load)

    for pairs in ([pair(f"s{i // 4}", i, i + 1) for i in range(40)], [pair("s", i, i + 1) for i in range(0, 40, 2)]):
        train, held = split_cases(pairs, "train"), split_cases(pairs, "held_out")
        seen = [{(each.scene, frame) for each in part for frame in each.frames} for part in (train, held)]
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
        (settings("rgbd", frame=1), [photos], "needs a posed data set"),
        (settings("rgbd", sketch=1), [photos], "no use for"),
        (settings("rgbd", world=1), [posed], "no use for"),
        (settings("rgbd", world=1), [tmp_path / "empty"], "holds no picture"),
        (settings("rgbd", world=1), [tmp_path / "gone"], "no such file or folder"),
    ):
        with pytest.raises(InputError, match=words):
            source_for(chosen, data, "train")


def test_real_pairs_make_samples(data_dir: Path) -> None:
    """A Kinect's frames: check_sample agrees, and no target depth is a gap."""
    source = source_for(settings("rgbd", frame=1), [data_dir / "data" / "kitchen_vpi"], "train")
    made = source.sample(0, np.random.default_rng(1))
    check_sample(made, NetworkSettings("rgbd"), 64)
    assert 0 < made["known_depth"].mean() < 1 and made["target"][3].min() > 0.05
