"""Training of the judge of guesses: crops, its loss terms, and the loop from crops to the file that the filler runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")


from dlama.errors import FileError, InputError  # noqa: E402
from dlama.evaluation.metrics.lpips import Lpips  # noqa: E402
from dlama.inpainters.choice.judge import open_judge  # noqa: E402
from dlama.training.data.batches import check_sample  # noqa: E402
from dlama.training.data.samples.guesses import INDEX, SIDE, GuessCrop, GuessSamples, read_crop  # noqa: E402
from dlama.training.loop.train import train  # noqa: E402
from dlama.training.losses.perceptual import LpipsLoss  # noqa: E402
from dlama.training.losses.terms import depth_choice, error_likelihood, relative_error  # noqa: E402
from dlama.training.presets import PRESETS  # noqa: E402


def random_crop(seed: int) -> GuessCrop:
    rng = np.random.default_rng(seed)
    context = rng.integers(0, 256, (10, SIDE, SIDE), np.uint8)
    context[-2:] = 255 * (rng.random((SIDE, SIDE)) < 0.3)
    return GuessCrop(
        context=context,
        color=rng.integers(0, 256, (4, 3, SIDE, SIDE), np.uint8),
        depth=rng.integers(0, 65536, (5, SIDE, SIDE), np.uint16),
        true_color=rng.integers(0, 256, (3, SIDE, SIDE), np.uint8),
        true_depth=rng.integers(0, 65536, (SIDE, SIDE), np.uint16),
        true_known=np.ones((SIDE, SIDE), np.uint8),
    )


@pytest.fixture
def folder(tmp_path):
    """A folder with two crops to train on and one held out."""
    for split, count in (("train", 2), ("held_out", 1)):
        (tmp_path / "crops" / split).mkdir(parents=True)
        (tmp_path / "crops" / split / INDEX).write_text("a\nb\nc\nd\n")
        for number in range(count):
            np.savez(tmp_path / "crops" / split / f"{number:05}.npz", **vars(random_crop(number)))
    return tmp_path / "crops"


def test_samples_keep_the_contract(folder):
    """Oracle: the contract's own check, at any size; guesses keep their colours with their depths."""
    network = PRESETS["choice"].settings.network
    for size in (192, 256):
        source = GuessSamples([folder], network, "train", size)
        sample = source.sample(1, np.random.default_rng(3))
        check_sample(sample, network, size)
        again = source.sample(1, np.random.default_rng(3))
        assert all(np.array_equal(sample[name], again[name]) for name in sample)
    with pytest.raises(InputError, match="256 at most"):
        GuessSamples([folder], network, "train", 300)
    with pytest.raises(FileError, match="no crop"):
        read_crop(folder / "train" / INDEX)


@pytest.mark.parametrize("hole", [0, 255])
def test_crops_that_teach_nothing_are_named(folder, hole):
    """Law: a crop that is all hole or has none is refused (squares of it were drawn for ever), as is one that was cut off."""
    path = folder / "train" / "00000.npz"
    crop = random_crop(0)
    crop.context[-2:] = hole
    np.savez(path, **vars(crop))
    network = PRESETS["choice"].settings.network
    with pytest.raises(FileError, match=rf"00000\.npz: its hole is {'full' if hole else 'empty'}"):
        GuessSamples([folder], network, "train", 64).sample(0, np.random.default_rng(0))
    path.write_bytes(path.read_bytes()[:-1000])
    with pytest.raises(FileError, match=r"00000\.npz: is no crop with guesses"):
        read_crop(path)


def test_terms_of_choice():
    """Closed form: weights 3/4 and 1/4 of guesses off by 0 and 0.4; log b + e / b."""
    output = torch.zeros(1, 8, 2, 2)
    output[:, 6], output[:, 7] = 0.75, 0.25
    output[:, 4] = float(np.log(0.2))
    guesses = torch.zeros(1, 8, 2, 2)
    guesses[:, 3], guesses[:, 7] = 0.5, 0.9
    target = torch.tensor([0.1, 0.1, 0.1, 0.5]).view(1, 4, 1, 1).expand(1, 4, 2, 2)
    ones = torch.ones(1, 1, 2, 2)
    batch = {"guesses": guesses, "target": target, "mask": ones, "known_depth": ones, "context": torch.ones(1, 5, 2, 2)}
    assert float(depth_choice(output, batch)) == pytest.approx(0.1)
    assert float(error_likelihood(output, batch)) == pytest.approx(np.log(0.2) + 0.1 / 0.2 + 0 + 0)
    found = relative_error(torch.tensor([0.5, 0.0, 0.0, 2 / 3]), torch.tensor([0.5, 0.0, 0.5, 0.5]))
    np.testing.assert_allclose(found, [0, 0, 1, 0.5], atol=1e-6)


def test_the_loss_is_the_measure():
    """Oracle: LPIPS as the evaluation runs it; and its gradient is finite where a picture equals the truth."""
    rng = np.random.default_rng(0)
    one, other = (rng.integers(0, 256, (64, 80, 3), np.uint8) for _ in range(2))
    mine, theirs = (torch.from_numpy(p.transpose(2, 0, 1)[None] / np.float32(255)) for p in (one, other))
    loss, metric = LpipsLoss(), Lpips()
    assert float(loss(mine, theirs)) == pytest.approx(metric.distance(*map(metric.features, (one, other))), rel=1e-3)
    same = theirs.clone().requires_grad_(True)
    loss(same, theirs).backward()
    assert torch.isfinite(same.grad).all()


def test_crops_train_a_judge_that_runs(folder, tmp_path):
    """Round trip: the loop's own file is a judge, its table of metrics has the terms of choice."""
    settings = PRESETS["choice"].settings
    small = replace(
        settings,
        network=replace(settings.network, width=8),
        data=replace(settings.data, size=64, held_out=1),
        loop=replace(settings.loop, steps=2, batch=2, precision="fp32", log_every=1, validate_every=2),
    )
    done = train(small, tmp_path / "run", data=[folder])
    assert open_judge(done.network).metadata
    header = (tmp_path / "run" / "metrics.csv").read_text().splitlines()[0]
    assert {"depth_choice", "expected_error", "perceptual", "l1_hole"} <= set(header.split(","))
