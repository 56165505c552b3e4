"""Crops that the painter is tuned on, and the generator as a torch module. Oracles: ONNX Runtime, and laws of a crop."""

from __future__ import annotations

import numpy as np
import pytest

from dlama.files.rasters.pictures import write_color
from dlama.inpainters import model_file
from painter_crops import (
    HOLE_SHARES,
    VIEW_SHARES,
    VIEW_SIDE,
    outlines_of,
    photo_crop,
    stored_crop,
    unseen_when_turned,
    write_views,
    write_worlds,
)

pytest.importorskip("torch")
pytest.importorskip("onnx")

SHIPPED = model_file("migan")


@pytest.fixture(scope="module")
def planes() -> np.ndarray:
    """1 x 4 x 128 x 256: colours, 0 in the hole, and the hole."""
    planes = np.random.default_rng(0).random((1, 4, 128, 256), np.float32)
    planes[:, 3] = 0
    planes[:, 3, 30:100, 60:200] = 1
    planes[:, :3] *= 1 - planes[:, 3:]
    return planes


def painted_by(path, planes) -> np.ndarray:
    """By ONNX Runtime."""
    import onnxruntime

    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return session.run(None, {"planes": planes})[0]


def test_the_module_paints_as_the_file(planes):
    """Oracle: ONNX Runtime, within a hundredth of a level."""
    import torch

    from painter_network import Generator

    with torch.no_grad():
        found = Generator(SHIPPED)(torch.from_numpy(planes))
    np.testing.assert_allclose(found.numpy() * 255, painted_by(SHIPPED, planes) * 255, atol=0.01)


def test_a_written_file_has_the_weights_of_the_module(planes, tmp_path):
    """Law: unchanged, it paints the same bits as the file it began with; changed, what the module paints."""
    import torch

    from painter_network import Generator

    module, path = Generator(SHIPPED), tmp_path / "tuned.onnx"
    module.write(SHIPPED, path)
    np.testing.assert_array_equal(painted_by(path, planes), painted_by(SHIPPED, planes))
    with torch.no_grad():
        for one in module.parameters():
            one.mul_(0.9)
        found = module(torch.from_numpy(planes)).numpy()
    module.write(SHIPPED, path)
    assert abs(found - painted_by(SHIPPED, planes)).max() > 0.1
    np.testing.assert_allclose(found, painted_by(path, planes), atol=0.01)  # weights in half precision


@pytest.mark.slow
def test_steps_bring_the_painting_nearer_to_the_truth(planes):
    """Law: repeated on one picture, the error in its hole falls, what was known and the noise stay as they were."""
    import torch

    from painter_network import Run

    torch.manual_seed(0)
    run, rng = Run(SHIPPED), np.random.default_rng(0)
    noise = {name: one.clone() for name, one in run.generator.named_parameters() if not one.requires_grad}
    truth = torch.from_numpy(rng.random((1, 3, 4, 4), np.float32)).repeat_interleave(32, 2).repeat_interleave(32, 3)
    hole = torch.zeros(1, 1, 128, 128)
    hole[..., 40:90, 40:90] = 1
    errors = [run.learn((truth, truth, hole, hole), rng)[0] for _ in range(12)]
    assert errors[-1] < 0.7 * errors[0]
    now = dict(run.generator.named_parameters())
    assert noise and all(torch.equal(now[name], before) for name, before in noise.items())


def test_crops_of_photos_and_worlds(tmp_path):
    """Law: the hole has a fitting size; a photo is its own truth; a world's truth differs where the object was."""
    rng = np.random.default_rng(0)
    picture = np.full((300, 280, 3), (60, 120, 40), np.uint8)
    picture[90:210, 80:180] = 230, 40, 30
    photos = [tmp_path / "a.png"]
    write_color(photos[0], picture)
    outlines = outlines_of(photos)
    assert len(outlines) == 1 and abs(outlines[0].shape[0] - 120) < 30 and abs(outlines[0].shape[1] - 100) < 30
    for _ in range(20):
        crop = photo_crop(photos, outlines, 128, rng)
        assert crop.color.shape == (128, 128, 3) and HOLE_SHARES[0] < crop.hole.mean() < VIEW_SHARES[1]
        np.testing.assert_array_equal(crop.color, crop.truth)
    write_worlds(tmp_path, 2, photos)
    files = sorted(tmp_path.glob("*.npz"))
    assert len(files) == 2
    with np.load(files[1]) as stored:
        changed = (stored["color"] != stored["truth"]).any(2)
        assert changed[stored["hole"]].mean() > 0.5
        nearer = stored["near"] > stored["true_near"]
        assert nearer[stored["hole"]].mean() > 0.9 and stored["near"].max() <= 1 and (stored["true_near"] >= 0).all()
    crop = stored_crop(files[1:], 256, rng)
    assert crop.hole.any() and crop.truth.max() <= 255 and not (crop.color == crop.truth)[crop.hole].all()


def test_a_turned_camera_sees_what_lies_ahead_of_both() -> None:
    """Law: the hole has a fitting size and reaches the border; what is seen has no hole in it, as two pyramids meet convexly."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        hole = unseen_when_turned(64, rng)
        assert VIEW_SHARES[0] < hole.mean() < VIEW_SHARES[1]
        assert all((np.diff(line.astype(int)) < 0).sum() <= 1 for line in (*hole, *hole.T))


@pytest.mark.slow
def test_crops_of_views(tmp_path):
    """Law: what is not hidden from the painter is as in the truth, in colour and depth; the truth of what counts is known."""
    rows, columns = np.indices((300, 280))
    picture = np.stack([rows // 2, columns // 2, (rows + columns) // 4], 2).astype(np.uint8)
    picture[90:210, 80:180] = 230, 40, 30
    write_color(tmp_path / "a.png", picture)
    write_views(tmp_path, 2, [tmp_path / "a.png"])
    files = sorted(tmp_path.glob("*.npz"))
    assert len(files) == 2
    for file in files:
        crop = stored_crop([file], VIEW_SIDE, np.random.default_rng(0))
        assert crop.color.shape == (VIEW_SIDE, VIEW_SIDE, 3)
        assert crop.counted.any() and not (crop.counted & ~crop.hole).any()
        with np.load(file) as stored:
            seen = ~stored["hole"]
            assert np.median(np.abs(stored["color"].astype(int) - stored["truth"])[seen]) <= 2
            assert np.median(np.abs(stored["near"].astype(float) - stored["true_near"])[seen]) < 0.01
