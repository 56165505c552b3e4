"""Two processes do what one does with the doubled batch."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="training needs torch: pip install 'dlama[train]'")
pytest.importorskip("pytorch_lightning", reason="the loop needs Lightning: pip install 'dlama[train]'")

from toy_runs import no_tensorboard, toy  # noqa: E402

from dlama.training.loop.checkpointing import LAST, read_checkpoint  # noqa: E402
from dlama.training.loop.run_files import read_metrics  # noqa: E402
from dlama.training.loop.train import train  # noqa: E402

SCRIPT = """
import sys
from dataclasses import replace
from pathlib import Path
from dlama.training.loop.train import train
from dlama.training.presets import settings_of
if __name__ == "__main__":
    settings = settings_of(sys.argv[1])
    train(settings, Path(sys.argv[2]))
    train(replace(settings, loop=replace(settings.loop, steps=3)), Path(sys.argv[2]), resume=True)
"""


def two_processes(settings, run: Path, tmp_path: Path) -> None:
    """Two steps, and a third after a resume, in a fresh interpreter that Lightning starts a second time by itself."""
    from dlama.training.presets import to_json

    script, chosen = tmp_path / "script.py", tmp_path / "settings.json"
    script.write_text(SCRIPT)
    chosen.write_text(to_json(settings))
    clean = {k: v for k, v in os.environ.items() if k not in ("LOCAL_RANK", "NODE_RANK", "WORLD_SIZE", "MASTER_PORT")}
    done = subprocess.run(
        [sys.executable, str(script), str(chosen), str(run)],
        env=clean | {"OMP_NUM_THREADS": "1", "MASTER_ADDR": "127.0.0.1"},
        capture_output=True,
        text=True,
        timeout=1800,  # against processes that wait for each other for ever; no measure of speed
    )
    assert done.returncode == 0, done.stderr[-3000:]


def relative(a, b) -> float:
    """The largest difference over the largest number."""
    return float((a - b).abs().max() / b.abs().max().clamp(min=1e-12))


def test_two_processes_are_one_with_the_doubled_batch(tmp_path):
    """Oracle: one process. Batch norms keep their statistics, or each process would see another mean.

    Mean gradients (Adam's first memory) agree to float32's rounding; weights to a hundredth of a step, since Adam turns
    the rounding of a gradient that is nearly 0 into a visible part of a step.
    """
    chosen = toy(steps=2, batch=4)
    chosen = replace(chosen, network=replace(chosen.network, frozen_norms=True))
    halves = replace(chosen, loop=replace(chosen.loop, batch=2, devices=2))
    two_processes(halves, tmp_path / "two", tmp_path)
    run = train(replace(chosen, loop=replace(chosen.loop, steps=3)), tmp_path / "one").run
    one, two = read_checkpoint(run / LAST), read_checkpoint(tmp_path / "two" / LAST)
    assert one["step"] == two["step"] == 3 and one["samples"] == two["samples"] == 12
    assert len(one["random_states"]) == 1 and len(two["random_states"]) == 2
    for mine, theirs in zip(two["optimizer_states"], one["optimizer_states"]):
        for i, state in theirs["state"].items():
            assert relative(mine["state"][i]["exp_avg"], state["exp_avg"]) < 2e-3, i
    step = chosen.optimiser.generator_rate
    for name, value in one["state_dict"].items():
        if value.is_floating_point():
            assert (two["state_dict"][name] - value).abs().mean() < 0.01 * step, name
    rows = read_metrics(tmp_path / "two")
    assert [row["step"] for row in rows] == [1, 2, 3] and [row["samples"] for row in rows] == [4, 8, 12]
    assert rows[1]["held_out_color_l1"] == pytest.approx(read_metrics(run)[1]["held_out_color_l1"], rel=1e-3)


no_tensorboard()


FULL_DISK = """
import errno, sys
from dataclasses import replace
from pathlib import Path
import torch
from dlama.errors import OutputError
from dlama.training.loop import callbacks
from dlama.training.loop.train import train
from dlama.training.presets import settings_of

def write(path, checkpoint):
    if checkpoint["step"] in (1, int(sys.argv[3])):
        raise OutputError("the disk is full")
    real(path, checkpoint)

real, callbacks.write_checkpoint = callbacks.write_checkpoint, write
kept = callbacks.TrainingModule.training_step
def spoiled(self, batch, index):
    if self.step == 1 and not self.restored:
        batch = batch | {"target": batch["target"] * float("nan")}
    kept(self, batch, index)
callbacks.TrainingModule.training_step = spoiled
if __name__ == "__main__":
    train(settings_of(sys.argv[1]), Path(sys.argv[2]))
"""


@pytest.mark.parametrize("last", [False, True])
def test_a_full_disk_of_the_first_process_is_every_process_s(tmp_path: Path, last: bool) -> None:
    """The checkpoint of step 1 fails and the next batch is bad: both processes return to the same state and end alike (oracle: a
    run on a disk that is never full has the same weights). Where the last checkpoint fails, both end, and none waits."""
    from dlama.training.presets import to_json

    chosen, results = toy(steps=3, batch=1, devices=2, checkpoint_every=1, guard_every=100), []
    for name, failing in (("full", 3 if last else 0), ("roomy", -1)):
        if last and name == "roomy":
            continue
        script, settings = tmp_path / f"{name}.py", tmp_path / "settings.json"
        text = FULL_DISK if name == "full" else FULL_DISK.replace("in (1, ", "in (-1, ")
        script.write_text(text)
        settings.write_text(to_json(chosen))
        clean = {
            k: v for k, v in os.environ.items() if k not in ("LOCAL_RANK", "NODE_RANK", "WORLD_SIZE", "MASTER_PORT")
        }
        done = subprocess.run(
            [sys.executable, str(script), str(settings), str(tmp_path / name), str(failing)],
            env=clean | {"OMP_NUM_THREADS": "1", "MASTER_ADDR": "127.0.0.1"},
            capture_output=True,
            text=True,
            timeout=600,  # against processes that wait for each other for ever; no measure of speed
        )
        if last:
            assert done.returncode != 0 and "the disk is full" in done.stderr
            return
        assert done.returncode == 0, done.stderr[-3000:]
        results.append(read_checkpoint(tmp_path / name / LAST))
    for key, value in results[0]["state_dict"].items():
        assert torch.equal(value, results[1]["state_dict"][key]), key
    assert results[0]["restored"] == results[1]["restored"] == 1
