"""The loop trains, exports what the filler `joint` runs, survives bad batches and full disks, and stops when chosen."""

from __future__ import annotations

import errno
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image
from toy_runs import Four, Spoiled, read_metrics, toy, world_source

from box_frame import WORLD
from dlama.apps.cli import main
from dlama.errors import DlamaError, InputError, OutputError
from dlama.files.rasters.depth import read_depth, write_depth_png
from dlama.files.rasters.pictures import write_color
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View
from dlama.inpainters.networks.contract import require_planes
from dlama.inpainters.networks.engine import Engine
from dlama.inpainters.networks.view_tensors import DepthPlane, color_planes, robust_scale
from dlama.nets.checkpoints import read_generator
from dlama.nets.generator import Generator, generator_from_state
from dlama.nets.safetensors_file import write_safetensors
from dlama.training import settings
from dlama.training.data import loader
from dlama.training.kinds import PLANES
from dlama.training.loop import checkpointing, module
from dlama.training.loop.checkpointing import LAST, read_checkpoint
from dlama.training.loop.module import initial_generator, update_average
from dlama.training.loop.train import TrainingResult, train
from dlama.training.loop.validation import hole_metrics, telea
from dlama.training.presets import PRESETS
from marks import first_quick


@pytest.fixture(scope="module")
def tiny_run(tmp_path_factory):
    """`dlama train tiny -o run`, as a user would; the run and its network."""
    run = tmp_path_factory.mktemp("tiny") / "run"
    main(["train", "tiny", "-o", str(run)])
    return TrainingResult(run, 40, "all steps done", run / "tiny.onnx")


@pytest.mark.slow
def test_tiny_leaves_everything_a_user_needs(tiny_run):
    """Oracle: the list of a run directory, and the card's words."""
    names = {path.relative_to(tiny_run.run).as_posix() for path in tiny_run.run.rglob("*.*")}
    assert {
        "settings.json",
        "metrics.csv",
        "log.txt",
        "last.ckpt",
        "tiny.onnx",
        "tiny.safetensors",
        "README.md",
    } <= names
    assert {"sheets/step-0000020.png", "sheets/step-0000040.png"} <= names
    card = (tiny_run.run / "README.md").read_text()
    assert "Perceptual trunk random" in card and "40 steps, 160 samples" in card and "| Telea |" in card
    assert "perceptual trunk random" in (tiny_run.run / "log.txt").read_text()


@pytest.mark.slow
def test_tinys_network_fills_a_view_from_the_command_line(tiny_run, tmp_path):
    """`dlama view --filler joint --model run/tiny.onnx`. Oracle: torch with the run's safetensors on the planes of the view
    that was written, its hole emptied again; nothing is left open, and meta.json names the file."""
    rgbd = WORLD.rgbd(Camera.from_fov(64, 64, 60))
    write_color(tmp_path / "image.png", rgbd.color)
    write_depth_png(tmp_path / "depth.png", rgbd.depth)
    words = ["--fov", "60", "--yaw", "15", "--filler", "joint", "--model", str(tiny_run.network), "--also", "hole"]
    main(["view", str(tmp_path / "image.png"), str(tmp_path / "depth.png"), *words, "-o", str(tmp_path / "out")])
    written = {name: np.array(Image.open(tmp_path / "out" / f"{name}.png")) for name in ("image", "origin", "hole")}
    hole = written["hole"] > 0
    assert 0.02 < hole.mean() < 0.5 and np.array_equal(written["origin"] == Origin.FILLED, hole)
    assert (written["origin"] > 0).all() and "tiny.onnx" in (tmp_path / "out" / "meta.json").read_text()
    seen = View.from_rgbd(RGBD(written["image"], read_depth(tmp_path / "out" / "depth.exr"), rgbd.camera))
    view = seen.without(hole, HoleType.DISOCCLUDED)
    planes = np.concatenate([color_planes(view.color), DepthPlane.of(view, robust_scale).values[None], hole[None]])
    planes = (planes * np.concatenate([np.broadcast_to(~hole, (4, *hole.shape)), hole[None]])).astype(np.float32)
    with torch.no_grad():
        network = generator_from_state(read_generator(tiny_run.run / "tiny.safetensors").state)
        expected = network(torch.from_numpy(planes)[None])[0, :3].numpy().transpose(1, 2, 0)
    assert np.abs(expected * 255 - written["image"])[hole].max() <= 1


@pytest.mark.slow
def test_tiny_learns_on_held_out_samples(tiny_run):
    """Oracle: its own learning curve; and every column of the metrics was written."""
    rows = read_metrics(tiny_run.run)
    looks = [row for row in rows if "held_out_color_l1" in row]
    assert [row["step"] for row in looks] == [20, 40] and rows[-1]["samples"] == 160
    assert looks[1]["held_out_color_l1"] < looks[0]["held_out_color_l1"]
    assert looks[1]["held_out_depth_l1"] < looks[0]["held_out_depth_l1"]
    assert rows[0].keys() | looks[0].keys() == set(
        (tiny_run.run / "metrics.csv").read_text().splitlines()[0].split(",")
    )


@pytest.mark.slow
def test_the_exported_network_is_the_moving_average(tiny_run):
    """Oracle: torch on the checkpoint's average, against onnxruntime on the exported file."""
    engine = Engine(tiny_run.network, threads=1)
    require_planes(engine.contract, 4, "tiny.onnx", "joint")
    sample = world_source(PRESETS["tiny"].settings.network, 64, "held_out").sample(0, np.random.default_rng(0))
    given = read_checkpoint(tiny_run.run / LAST)["state_dict"]
    average = {
        key.removeprefix("average."): value.numpy() for key, value in given.items() if key.startswith("average.")
    }
    with torch.no_grad():
        expected = generator_from_state(average)(torch.from_numpy(sample["input"])[None]).numpy()
    got = engine.run_planes(sample["target"][None], sample["mask"][0] > 0)
    np.testing.assert_allclose(got, expected, atol=1e-5)
    assert expected.std() > 0.05


@pytest.mark.slow
def test_the_checkpoint_is_a_lama_checkpoint(tiny_run):
    """Oracle: the reader of anybody's checkpoints finds the network in it that is exported; fine-tuning can start from it."""
    weights, exported = read_generator(tiny_run.run / LAST), read_generator(tiny_run.run / "tiny.safetensors")
    assert all(np.array_equal(weights.state[name], array) for name, array in exported.state.items())
    assert weights.settings == PRESETS["tiny"].settings.network.generator
    again = initial_generator(replace(PRESETS["tiny"].settings.network, start=str(tiny_run.run / "tiny.safetensors")))
    assert sum(p.numel() for p in again.parameters()) == sum(
        v.size for k, v in weights.state.items() if "running" not in k and "num" not in k
    )


@pytest.mark.slow
def test_a_tiny_network_overfits_four_samples_and_beats_telea(tmp_path, monkeypatch):
    """Oracle: OpenCV's Telea on the same four holes, in colour and in depth."""
    chosen = toy(size=32, steps=150, batch=4, validate_every=150, log_every=50)
    network = replace(chosen.network, width=12, blocks=2)
    loss = replace(chosen.loss, adversarial=1.0, feature_matching=10.0, l1_hole=30.0, depth_l1=30.0)
    chosen = replace(chosen, network=network, loss=loss, data=replace(chosen.data, held_out=4))
    chosen = replace(chosen, optimiser=replace(chosen.optimiser, generator_rate=3e-3, average=0.95, decay="cosine"))
    four = Four(network, 32)
    monkeypatch.setattr("dlama.training.loop.train.source_for", lambda *_: four)
    run = train(chosen, tmp_path / "run").run
    batch = loader.held_out_batch(four, chosen)
    beaten = hole_metrics(telea(batch), batch, network)
    reached = read_metrics(run)[-1]
    for name in ("color_l1", "depth_l1"):
        assert reached[f"held_out_{name}"] < 0.8 * beaten[name], name
    assert reached["held_out_color_psnr"] > beaten["color_psnr"] + 1


@pytest.mark.parametrize("planes", first_quick(["stereo", "rgb", "stereo-two-masks"]))
def test_other_planes_train_and_export(planes, tmp_path):
    """Oracle: the exported file's own planes; no column of depth."""
    done = train(toy(planes, steps=2), tmp_path / "run")
    weights = read_generator(done.run / "toy.safetensors")
    assert (weights.settings.in_channels, weights.settings.out_channels) == (
        PLANES[planes].inputs,
        PLANES[planes].outputs,
    )
    assert not any("depth" in name for row in read_metrics(done.run) for name in row)
    assert done.network.is_file() and (done.run / "README.md").is_file()


def test_a_bad_batch_does_not_kill_the_run(tmp_path):
    """Oracle: law; the weights after the bad step are those of the last state that was kept, and the run continues."""
    chosen = toy(steps=5)
    seen = {}

    class Watched(module.TrainingModule):
        def training_step(self, batch, index):
            super().training_step(batch, index)
            seen[self.step] = {key: value.clone() for key, value in self.generator.state_dict().items()}

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dlama.training.loop.train.TrainingModule", Watched)
        patch.setattr(module, "GUARD_EVERY", 2)
        # the first call is the check before the run; calls 7 and 8 are the fourth batch
        sources = {"train": Spoiled(chosen, {7, 8}), "held_out": world_source(chosen.network, 32, "held_out")}
        patch.setattr("dlama.training.loop.train.source_for", lambda settings, data, split: sources[split])
        done = train(chosen, tmp_path / "run")
    assert done.step == 5 and read_checkpoint(done.run / LAST)["restored"] == 1
    assert all(torch.equal(seen[2][key], seen[4][key]) for key in seen[2])
    assert any(not torch.equal(seen[3][key], seen[4][key]) for key in seen[2])
    assert all(value.isfinite().all() for value in seen[5].values())
    rows = read_metrics(done.run)
    assert math.isnan(rows[3]["gradient_norm"]) and math.isfinite(rows[4]["gradient_norm"])


def test_nothing_but_bad_batches_ends_the_run(tmp_path, monkeypatch):
    """Oracle: law; the message says so, and the last checkpoint is of a good state."""
    chosen = toy(steps=60, checkpoint_every=2)
    sources = {"train": Spoiled(chosen, set(range(7, 200))), "held_out": world_source(chosen.network, 32, "held_out")}
    monkeypatch.setattr("dlama.training.loop.train.source_for", lambda settings, data, split: sources[split])
    with pytest.raises(DlamaError, match="20 batches in a row"):
        train(chosen, tmp_path / "run")
    kept = read_checkpoint(tmp_path / "run" / LAST)
    assert all(value.isfinite().all() for value in kept["state_dict"].values())


def test_a_full_disk_leaves_the_old_checkpoint_whole(tmp_path, monkeypatch):
    """Oracle: the bytes of the file before; nothing else is left behind, in both ways that torch fails."""
    path = tmp_path / "last.ckpt"
    checkpointing.write_checkpoint(path, {"version": 1, "weights": torch.ones(3)})
    before = path.read_bytes()

    def full(kind):
        def save(item, stream):
            stream.write(b"half of it")
            raise (
                kind(errno.ENOSPC, "No space left on device") if kind is OSError else kind("PytorchStreamWriter failed")
            )

        return save

    for kind in (OSError, RuntimeError):
        monkeypatch.setattr(torch, "save", full(kind))
        with pytest.raises(OutputError, match="what was there is whole"):
            checkpointing.write_checkpoint(path, {"version": 1})
        assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_the_run_continues_when_a_checkpoint_fails_but_not_without_the_last(tmp_path, monkeypatch):
    """Oracle: law; a checkpoint on the way may fail, which the log says, the last one may not."""
    failing = {1}

    def write(path, checkpoint):
        if checkpoint["step"] in failing:
            raise OutputError("the disk is full")
        real(path, checkpoint)

    real = checkpointing.write_checkpoint
    monkeypatch.setattr("dlama.training.loop.callbacks.write_checkpoint", write)
    run = train(toy(steps=2, checkpoint_every=1), tmp_path / "run").run
    assert "step 1: the disk is full; the run continues" in (run / "log.txt").read_text()
    failing.add(3)
    with pytest.raises(OutputError, match="the disk is full"):
        train(toy(steps=3), run, resume=True)
    assert read_checkpoint(run / LAST)["step"] == 2


def test_what_is_refused_leaves_no_run(tmp_path):
    """Oracle: law; after a wrong --data the same directory takes the right command."""
    with pytest.raises(InputError, match="no such folder"):
        train(toy(steps=1), tmp_path / "run", data=[tmp_path / "gone"])
    for minutes in (0, -1, math.nan):
        with pytest.raises(InputError, match=r"max_minutes is .*; more than 0 is expected"):
            train(toy(steps=1), tmp_path / "run", max_minutes=minutes)
    assert not list(tmp_path.iterdir())
    assert train(toy(steps=1), tmp_path / "run").step == 1


def test_time_is_up(tmp_path):
    """Oracle: law; one step at least, a checkpoint, and the network as it is then."""
    done = train(toy(steps=10_000), tmp_path / "run", max_minutes=0.01)
    assert done.ended == "time is up" and 1 <= done.step < 10_000
    assert done.network is not None and read_checkpoint(done.run / LAST)["step"] == done.step


def test_bfloat16_trains(tmp_path):
    """Oracle: law; losses are finite and weights stay float32."""
    done = train(toy(steps=2, precision="bf16"), tmp_path / "run")
    state = read_checkpoint(done.run / LAST)["state_dict"]
    assert {value.dtype for value in state.values()} == {torch.float32, torch.int64}
    assert all(math.isfinite(value) for row in read_metrics(done.run) for value in row.values())


def test_terms_of_weight_0_are_not_there(tmp_path):
    """Oracle: law; without a judge there is no discriminator to keep."""
    chosen = toy(steps=2)
    loss = replace(chosen.loss, adversarial=0.0, feature_matching=0.0, perceptual=0.0, depth_normal=0.0)
    done = train(replace(chosen, loss=loss), tmp_path / "run")
    kept = read_checkpoint(done.run / LAST)
    assert (
        not any(name.startswith("discriminator") for name in kept["state_dict"]) and len(kept["optimizer_states"]) == 1
    )
    assert {"l1_known", "depth_l1", "depth_gradient", "depth_law", "gradient_norm"} < set(read_metrics(done.run)[0])
    assert "no perceptual term" in (done.run / "README.md").read_text().lower()


def test_fine_tuning_starts_where_lama_ended(tmp_path):
    """Oracle: the network before surgery: at step 0 colour is filled as before, with two more planes around it."""
    lama = Generator(settings.NetworkSettings("rgb", width=8, blocks=1, downsamplings=2).generator).eval()
    path = tmp_path / "lama.safetensors"
    write_safetensors(path, {key: np.array(value.numpy()) for key, value in lama.state_dict().items()})
    network = settings.NetworkSettings("rgbd", width=8, blocks=1, downsamplings=2, start=str(path))
    picture = torch.rand(1, 5, 16, 16)
    with torch.no_grad():
        got = initial_generator(network).eval()(picture)[:, :3]
        torch.testing.assert_close(got, lama(picture[:, [0, 1, 2, 4]]), rtol=0, atol=1e-6)
    with pytest.raises(InputError, match="is expected by the settings"):
        initial_generator(replace(network, blocks=2))


def test_the_moving_average():
    """Oracle: closed form; the memory is short at first, and an average of equal numbers is that number."""
    network = torch.nn.Linear(1, 1, bias=False)
    average = torch.nn.Linear(1, 1, bias=False).requires_grad_(False)
    torch.nn.init.constant_(average.weight, 0.0)
    torch.nn.init.constant_(network.weight, 1.0)
    update_average(average, network, 0.9, step=0)
    assert float(average.weight) == pytest.approx(0.9)
    update_average(average, network, 0.9, step=1000)
    assert float(average.weight) == pytest.approx(0.9 * 0.9 + 0.1)


def test_learning_rates():
    """Oracle: closed forms; a straight rise, then half a cosine down to a hundredth."""
    chosen = toy(steps=100)
    chosen = replace(chosen, optimiser=replace(chosen.optimiser, warm_up=4, decay="cosine"))
    rates = [module.rate_factor(chosen, step) for step in range(101)]
    assert rates[0] == pytest.approx(0.2, rel=1e-2) and rates[100] == pytest.approx(0.01)
    assert rates[50] == pytest.approx(0.505) and max(rates) == rates[4]
    flat = replace(chosen, optimiser=replace(chosen.optimiser, decay="none"))
    assert [module.rate_factor(flat, step) for step in (0, 1, 4, 99)] == [0.2, 0.4, 1, 1]
