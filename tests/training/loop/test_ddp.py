"""Two processes do what one does with the doubled batch, and end alike when the disk is full.

All runs are made one after the other by one pair of processes: their start costs far more than the training.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from toy_runs import keep_statistics, read_metrics, toy

from dlama.training.loop.checkpointing import LAST, read_checkpoint
from dlama.training.loop.module import TrainingModule
from dlama.training.loop.train import train
from dlama.training.presets import to_json
from dlama.training.settings import TrainSettings

SCRIPT = """
import sys
from dataclasses import replace
from pathlib import Path
from dlama.errors import OutputError
from dlama.training.loop import callbacks
from dlama.training.loop.train import train
from dlama.training.presets import settings_of
from toy_runs import keep_statistics, keep_worlds

full, spoiled = (), False
keep_worlds()

def write(path, checkpoint):
    if checkpoint["step"] in full:
        raise OutputError("the disk is full")
    real(path, checkpoint)

real, callbacks.write_checkpoint = callbacks.write_checkpoint, write
module = callbacks.TrainingModule
module.train = keep_statistics(module.train)
kept = module.training_step
def step(self, batch, index):
    if spoiled and self.step == 1 and not self.restored:
        batch = batch | {"target": batch["target"] * float("nan")}
    kept(self, batch, index)
module.training_step = step

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    halves, each = (settings_of(str(folder / name)) for name in ("halves.json", "each.json"))
    train(halves, folder / "two")
    train(replace(halves, loop=replace(halves.loop, steps=3)), folder / "two", resume=True)
    spoiled = True
    train(each, folder / "roomy")
    full = (1,)
    train(each, folder / "full")
    (folder / "all but the last").touch()
    train(replace(each, loop=replace(each.loop, steps=1)), folder / "last")
"""
"""Two steps, and a third after a resume; a run whose second batch is bad at first, on a disk that is never full, on one that is
full at step 1, and one step on one that is full then. Batch norms keep their statistics in all of them."""


def doubled() -> TrainSettings:
    """Of one process; two take half the batch each."""
    return toy(steps=2, batch=4)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """The folder of all runs, and how their processes ended: an interpreter that Lightning starts a second time by itself."""
    folder, chosen = tmp_path_factory.mktemp("ddp"), doubled()
    halves = replace(chosen, loop=replace(chosen.loop, batch=2, devices=2))
    each = toy(steps=3, batch=1, devices=2, checkpoint_every=1)
    script = folder / "script.py"
    for path, text in (
        (script, SCRIPT),
        (folder / "halves.json", to_json(halves)),
        (folder / "each.json", to_json(each)),
    ):
        path.write_text(text)
    clean = {k: v for k, v in os.environ.items() if k not in ("LOCAL_RANK", "NODE_RANK", "WORLD_SIZE", "MASTER_PORT")}
    done = subprocess.run(
        [sys.executable, str(script), str(folder)],
        env=clean | {"PYTHONPATH": os.pathsep.join(sys.path), "OMP_NUM_THREADS": "1", "MASTER_ADDR": "127.0.0.1"},
        capture_output=True,
        text=True,
        timeout=1800,  # against processes that wait for each other for ever; no measure of speed
    )
    assert (folder / "all but the last").exists(), done.stderr[-3000:]
    return folder, done


def relative(a, b) -> float:
    """The largest difference over the largest number."""
    return float((a - b).abs().max() / b.abs().max().clamp(min=1e-12))


@pytest.mark.slow
def test_two_processes_are_one_with_the_doubled_batch(runs, tmp_path, monkeypatch):
    """Oracle: one process. Batch norms keep their statistics, or each process would see another mean.

    Mean gradients (Adam's first memory) agree to float32's rounding; weights to a hundredth of a step, since Adam turns
    the rounding of a gradient that is nearly 0 into a visible part of a step.
    """
    monkeypatch.setattr(TrainingModule, "train", keep_statistics(TrainingModule.train))
    chosen, together = doubled(), runs[0] / "two"
    run = train(replace(chosen, loop=replace(chosen.loop, steps=3)), tmp_path / "one").run
    one, two = read_checkpoint(run / LAST), read_checkpoint(together / LAST)
    assert one["step"] == two["step"] == 3 and one["samples"] == two["samples"] == 12
    assert len(one["random_states"]) == 1 and len(two["random_states"]) == 2
    for mine, theirs in zip(two["optimizer_states"], one["optimizer_states"]):
        for i, state in theirs["state"].items():
            assert relative(mine["state"][i]["exp_avg"], state["exp_avg"]) < 2e-3, i
    step = chosen.optimiser.generator_rate
    for name, value in one["state_dict"].items():
        if value.is_floating_point():
            assert (two["state_dict"][name] - value).abs().mean() < 0.01 * step, name
    rows = read_metrics(together)
    assert [row["step"] for row in rows] == [1, 2, 3] and [row["samples"] for row in rows] == [4, 8, 12]
    assert rows[1]["held_out_color_l1"] == pytest.approx(read_metrics(run)[1]["held_out_color_l1"], rel=1e-3)


@pytest.mark.slow
def test_a_full_disk_of_the_first_process_is_every_process_s(runs) -> None:
    """The checkpoint of step 1 fails and the next batch is bad: both processes return to the same state and end alike (oracle: a
    run on a disk that is never full has the same weights)."""
    full, roomy = (read_checkpoint(runs[0] / name / LAST) for name in ("full", "roomy"))
    for key, value in full["state_dict"].items():
        assert torch.equal(value, roomy["state_dict"][key]), key
    assert full["restored"] == roomy["restored"] == 1


@pytest.mark.slow
def test_where_the_last_checkpoint_fails_both_processes_end(runs) -> None:
    """And none waits for the other (oracle: the exit code and message)."""
    done = runs[1]
    assert done.returncode != 0 and "the disk is full" in done.stderr
