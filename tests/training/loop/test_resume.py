"""A run that was stopped and resumed ends with the same numbers, bit for bit, as one that was not."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from toy_runs import Exploit, read_metrics, toy, world_source

from dlama.errors import FileError, InputError, OutputError
from dlama.training.data.loader import NumberedSamples, batch_loader, batch_numbers
from dlama.training.loop import callbacks
from dlama.training.loop.checkpointing import LAST, read_checkpoint
from dlama.training.loop.module import TrainingModule
from dlama.training.loop.train import train


class Restless(TrainingModule):
    """Draws from torch's random numbers in every step, to see whether those are restored."""

    def training_step(self, batch, batch_index):
        noise = torch.rand(batch["target"].shape)
        super().training_step(batch | {"target": (batch["target"] + 0.01 * noise).clamp(0, 1)}, batch_index)


def everything(run):
    """Every tensor of a checkpoint, by its path."""
    found = {}

    def walk(at, node):
        if isinstance(node, torch.Tensor):
            found[at] = node
        elif isinstance(node, dict):
            for key, value in node.items():
                walk(f"{at}/{key}", value)
        elif isinstance(node, (list, tuple)):
            for key, value in enumerate(node):
                walk(f"{at}/{key}", value)
        elif not at.endswith(("/seconds", "/settings")):
            found[at] = node

    walk("", read_checkpoint(run / LAST))
    return found


def assert_same(a, b):
    """Equal in every bit, and of the same names."""
    assert set(a) == set(b)
    for name, value in a.items():
        same = torch.equal(value, b[name]) if isinstance(value, torch.Tensor) else value == b[name]
        assert same, name


@pytest.mark.slow
def test_resumed_is_bit_exact(tmp_path, monkeypatch):
    """Oracle: the run that was never stopped: networks, average, optimisers, random numbers and position.

    Learning rates that change, a penalty on every third step, and steps that draw random numbers.
    """
    handler = signal.getsignal(signal.SIGTERM)  # a library that another test used may have set its own
    settings = toy(steps=7)
    settings = replace(settings, optimiser=replace(settings.optimiser, warm_up=3, decay="cosine"))
    settings = replace(settings, loss=replace(settings.loss, penalty_every=3))
    monkeypatch.setattr("dlama.training.loop.train.TrainingModule", Restless)
    whole = train(settings, tmp_path / "whole")

    class Stop(callbacks.StopRequest):
        def is_requested(self, trainer):
            if trainer.lightning_module.step == 3:
                os.kill(os.getpid(), signal.SIGTERM)
            return super().is_requested(trainer)

    with monkeypatch.context() as patch:
        patch.setattr("dlama.training.loop.callbacks.StopRequest", Stop)
        part = train(settings, tmp_path / "parts")
    assert (part.ended, part.step, part.network) == ("SIGTERM", 3, None)
    torch.rand(7)  # whatever happens in between
    rest = train(settings, tmp_path / "parts", resume=True)
    assert rest.step == whole.step == 7
    assert_same(everything(whole.run), everything(rest.run))
    assert rest.network.read_bytes() == whole.network.read_bytes()
    assert [row["step"] for row in read_metrics(rest.run)] == [1, 2, 3, 4, 5, 6, 7]
    assert signal.getsignal(signal.SIGTERM) is handler


def test_another_seed_is_seen(tmp_path):
    """The guard above can fail."""
    runs = [train(toy(steps=1, seed=seed), tmp_path / str(seed)).run for seed in (0, 1)]
    with pytest.raises(AssertionError):
        assert_same(*map(everything, runs))


def test_rows_after_the_checkpoint_are_done_again(tmp_path):
    """Oracle: law; a run that was killed between two checkpoints has rows that never happened."""
    run = train(toy(steps=2), tmp_path / "run").run
    with (run / "metrics.csv").open("a") as stream:
        stream.write("3,12,1e9" + "\n")
    train(toy(steps=4), run, resume=True)
    rows = read_metrics(run)
    assert [row["step"] for row in rows] == [1, 2, 3, 4] and rows[2]["seconds"] < 1e9
    assert "held_out_color_l1" in rows[3] and "held_out_color_l1" not in rows[2]


def test_a_finished_run_is_exported_again(tmp_path):
    """Oracle: the files of the first time."""
    run = train(toy(steps=2), tmp_path / "run").run
    before = (run / "toy.onnx").read_bytes()
    (run / "toy.onnx").unlink()
    assert train(toy(steps=2), run, resume=True).network.read_bytes() == before


def test_a_run_continues_with_the_data_that_it_began_with(tmp_path, monkeypatch):
    """Resumed without `data`, from elsewhere, a run reads the folders of its beginning, named relative to where that was."""
    folder, run, asked = tmp_path / "photos", tmp_path / "run", []
    folder.mkdir()
    (tmp_path / "else").mkdir()

    def source(settings, data, split):
        asked.append(list(data))
        return world_source(settings.network, settings.data.size, split)

    monkeypatch.setattr("dlama.training.loop.train.source_for", source)
    monkeypatch.chdir(tmp_path)
    train(toy(steps=1), run, data=[Path("photos")])
    monkeypatch.chdir(tmp_path / "else")
    train(toy(steps=2), run, resume=True)
    assert asked == [[Path("photos")]] * 2 + [[folder]] * 2


def test_what_cannot_be_resumed(tmp_path):
    """Oracle: law; each message names what is wrong."""
    with pytest.raises(FileError, match="no run to resume"):
        train(toy(), tmp_path / "none", resume=True)
    run = train(toy(steps=1), tmp_path / "run").run
    with pytest.raises(OutputError, match="give resume to continue it"):
        train(toy(), run)
    with pytest.raises(InputError, match=r"loop.batch is 3, the run to resume has 2"):
        train(toy(batch=3), run, resume=True)
    (run / LAST).write_bytes((run / LAST).read_bytes()[:1000])
    with pytest.raises(FileError, match=r"last\.ckpt: cannot be read"):
        train(toy(), run, resume=True)
    (run / LAST).unlink()
    with pytest.raises(FileError, match="no such checkpoint"):
        train(toy(), run, resume=True)


def test_a_checkpoint_that_would_run_code_is_refused(tmp_path):
    """Oracle: the marker file of a pickle that writes one; the standard unpickler writes it."""
    torch.save({"version": 1, "callbacks": Exploit(tmp_path / "ran")}, tmp_path / "last.ckpt")
    with pytest.raises(FileError, match=r"last\.ckpt: cannot be read"):
        read_checkpoint(tmp_path / "last.ckpt")
    assert not (tmp_path / "ran").exists()
    torch.load(tmp_path / "last.ckpt", weights_only=False)
    assert (tmp_path / "ran").exists()


def test_batches_are_a_function_of_the_position():
    """Oracle: law; two processes together take what one takes with the doubled batch, also from the middle on."""
    assert [number for batch in batch_numbers(0, 6, 4) for number in batch] == list(range(24))
    halves = [batch_numbers(8, 4, 2, rank, 2) for rank in (0, 1)]
    assert [[*a, *b] for a, b in zip(*halves)] == [list(batch) for batch in batch_numbers(8, 4, 4)]


@pytest.mark.parametrize("group_size", [1, 2])
def test_every_index_comes_once_per_epoch(group_size):
    """Oracle: law; a shuffling, another one in the next epoch, and the same one every time."""

    class Forty:
        def __init__(self):
            self.group_size = group_size

        def __len__(self):
            return 40

    numbered = NumberedSamples(Forty(), seed=3)
    epochs = [[numbered.index(number) for number in range(start, start + 40)] for start in (0, 40)]
    assert sorted(epochs[0]) == sorted(epochs[1]) == list(range(40)) and epochs[0] != epochs[1]
    assert [NumberedSamples(Forty(), 3).index(number) for number in range(40)] == epochs[0]
    if group_size > 1:  # eight samples of four worlds: each world twice, in turn
        worlds = [index // group_size for index in epochs[0][:8]]
        assert worlds[:4] == worlds[4:] and len(set(worlds)) == 4
        assert [index % group_size for index in epochs[0][:8]] == [0, 0, 0, 0, 1, 1, 1, 1]


@pytest.mark.slow
def test_workers_give_the_same_batches():
    """Oracle: the batches made without workers."""
    settings = toy()
    source = world_source(settings.network, 32, "train")
    made = [
        list(
            batch_loader(
                source, replace(settings, data=replace(settings.data, workers=workers)), batch_numbers(4, 2, 2)
            )
        )
        for workers in (0, 1)
    ]
    assert all(torch.equal(a[key], b[key]) for a, b in zip(*made) for key in a)
