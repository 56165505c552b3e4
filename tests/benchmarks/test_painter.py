"""MI-GAN's generator as the torch module that is tuned (oracle: ONNX Runtime), and what it is tuned on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

from dlama.inpainters import model_file
from painter_crops import compressed, write_pack
from painter_data import GUIDES, LARGE_SIDE, SIDE, Crops, decoded, read_pack
from painter_network import Generator, Run, Weights

SHIPPED = model_file("migan")
CPU = torch.device("cpu")


def painted_by(path: Path, planes: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return session.run(None, {"planes": planes})[0]


def random_planes(count: int) -> np.ndarray:
    """1 x count x 128 x 256: colours with a hole, its mask, and whatever else."""
    planes = np.random.default_rng(0).random((1, count, 128, 256), np.float32)
    planes[:, 3] = 0
    planes[:, 3, 30:100, 60:200] = 1
    planes[:, :3] *= 1 - planes[:, 3:4]
    return planes


@pytest.mark.slow
def test_the_module_paints_as_the_file_and_a_written_file_as_the_module(tmp_path: Path) -> None:
    """Within a hundredth of a level; unchanged, the same bits as the file it began with; changed, what the module paints."""
    planes = random_planes(4)
    module, path, shipped = Generator(SHIPPED), tmp_path / "tuned.onnx", painted_by(SHIPPED, planes)
    with torch.no_grad():
        np.testing.assert_allclose(module(torch.from_numpy(planes)).numpy() * 255, shipped * 255, atol=0.01)
    module.write(SHIPPED, path)
    np.testing.assert_array_equal(painted_by(path, planes), shipped)
    with torch.no_grad():
        for one in module.parameters():
            one.mul_(0.9)
        found = module(torch.from_numpy(planes)).numpy()
    module.write(SHIPPED, path)
    assert abs(found - shipped).max() > 0.1
    np.testing.assert_allclose(found, painted_by(path, planes), atol=0.01)  # weights in half precision


def test_guides_change_nothing_at_first_and_count_in_the_written_file(tmp_path: Path) -> None:
    """Oracle: the file without guides; then the module."""
    planes = random_planes(4 + GUIDES)
    module, path, shipped = (
        Generator(SHIPPED, guided=True),
        tmp_path / "guided.onnx",
        painted_by(SHIPPED, planes[:, :4]),
    )
    with torch.no_grad():
        np.testing.assert_allclose(module(torch.from_numpy(planes)).numpy() * 255, shipped * 255, atol=0.01)
        next(one for one in module.learnt.values() if one.shape[1:2] == (4 + GUIDES,))[:, 4:] += 0.1
        found = module(torch.from_numpy(planes)).numpy()
    module.write(SHIPPED, path)
    assert abs(found - shipped).max() > 0.1
    np.testing.assert_allclose(found, painted_by(path, planes), atol=0.01)


def write_packs(folder: Path) -> None:
    """Two crops of each kind; of views the right half is open, and of that the lower half out of view."""
    rng = np.random.default_rng(1)
    planes = {side: [rng.integers(0, 256, (side, side, 3), np.uint8) for _ in range(2)] for side in (SIDE, LARGE_SIDE)}
    hole = {side: np.zeros((side, side), np.uint8) for side in planes}
    flags = np.zeros((SIDE, SIDE, 3), np.uint8)
    flags[:, SIDE // 2 :, :2], flags[SIDE // 2 :, SIDE // 2 :, 2] = 255, 255
    for side, one in hole.items():
        one[side // 4 : side // 2, side // 4 : side // 2] = 255
    small, large = planes[SIDE], planes[LARGE_SIDE]
    write_pack(folder / "photos.npz", ({"photo": compressed({"photo": one})["photo"]} for one in large))
    write_pack(
        folder / "worlds.npz",
        (compressed({"color": one, "truth": one, "mask": hole[LARGE_SIDE]}) for one in large),
    )
    view = {"truth": small[0], "surface": small[1], "near": hole[SIDE], "flags": flags}
    write_pack(folder / "views0.npz", (compressed({"color": one, **view}) for one in small))
    np.savez(
        folder / "holes.npz", **{str(side): np.packbits(np.stack([one > 0] * 2), axis=2) for side, one in hole.items()}
    )


def test_what_is_packed_is_what_is_read_and_holes_lie_where_they_were_stored(tmp_path: Path) -> None:
    """Laws: planes that are no pictures keep their bits; only views have guides, the surface in what is open; what counts of a
    view is open."""
    write_packs(tmp_path)
    stored = read_pack(tmp_path / "views0.npz")
    assert [sorted(one) for one in stored] == [["color", "flags", "near", "surface", "truth"]] * 2
    assert decoded(stored[0]["flags"])[-1, -1].tolist() == [255, 255, 255]
    crops = Crops(tmp_path, CPU)
    for kind, guided in (("photos", False), ("large photos", False), ("worlds", False), ("views", True)):
        (batch,) = crops.whole(kind, 8)
        assert batch.hole.any() and bool(batch.guides.any()) == guided
        assert not (batch.counted > batch.hole).any()
    assert batch.hole[..., SIDE // 2 :].all() and not batch.hole[..., : SIDE // 2].any()
    assert not batch.guides[:, :3, :, : SIDE // 2].any() and batch.guides[:, 5, SIDE // 2 :, SIDE // 2 :].all()


@pytest.mark.slow
def test_a_step_trains_the_generator_on_what_is_drawn(tmp_path: Path) -> None:
    """The same seed gives the same batch; known colours are the truth; weights move, noise does not; a saved run continues."""
    write_packs(tmp_path)
    crops = Crops(tmp_path, CPU)
    batch, again = (crops.draw(3, np.random.default_rng(2)) for _ in range(2))
    assert all(torch.equal(one, other) for one, other in zip(batch, again))
    run = Run(SHIPPED, CPU, Weights(squared=1.0), guided=True)
    before = {name: one.clone() for name, one in run.generator.learnt.items()}
    run.step = 800  # past the steps in which the discriminator learns alone
    small = type(batch)(*(plane[:1, :, :128, :128] for plane in batch))
    assert torch.isfinite(run.learn(small, np.random.default_rng(3))).all()
    moved = {name for name, one in run.generator.learnt.items() if not torch.equal(one, before[name])}
    assert moved == {name for name, one in run.generator.learnt.items() if one.requires_grad}
    run.save(tmp_path / "state.pt")
    other = Run(SHIPPED, CPU, Weights(), guided=True)
    other.load(tmp_path / "state.pt")
    assert other.step == 801
    assert all(torch.equal(a, b) for a, b in zip(run.averaged.parameters(), other.averaged.parameters()))
