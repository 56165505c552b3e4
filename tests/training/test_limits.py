"""Devices and memory that are not there are refused first (oracles: counted modules of real networks, computers made up)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from torch import nn
from toy_runs import toy

from dlama.errors import InputError
from dlama.nets.generator import Generator
from dlama.training import limits
from dlama.training.limits import check_machine, generator_numbers, training_bytes
from dlama.training.loop.train import train
from dlama.training.presets import PRESETS


@pytest.fixture
def small_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four cores, 8 GB, no GPU."""
    monkeypatch.setattr(limits, "processor_count", lambda: 4)
    monkeypatch.setattr(limits, "available_bytes", lambda: int(8e9))
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)


@pytest.mark.parametrize(
    "accelerator, there", [("cpu", "4 processor cores"), ("auto", "4 processor cores"), ("gpu", "0 GPUs")]
)
def test_more_devices_than_there_are(small_computer: None, tmp_path: Path, accelerator: str, there: str) -> None:
    """Before anything starts or is written."""
    with pytest.raises(InputError, match=f"loop.devices is 9999; this computer has {there}"):
        train(toy(accelerator=accelerator, devices=9999), tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_gpus_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    with pytest.raises(InputError, match="has 2 GPUs, so at most 2"):
        limits.check_devices(toy(accelerator="auto", devices=3))
    limits.check_devices(toy(accelerator="auto", devices=2))


def test_what_memory_cannot_hold(small_computer: None) -> None:
    """Network, size and batch, each alone; every preset fits a computer it is meant for."""
    base = toy()
    check_machine(base)
    for settings in (
        replace(base, network=replace(base.network, width=1024, blocks=500)),
        replace(base, data=replace(base.data, size=32768)),
        replace(base, loop=replace(base.loop, batch=10_000_000)),
    ):
        with pytest.raises(InputError, match=r"take at least [0-9.]+ GB of memory, 8.0 GB are free"):
            check_machine(settings)
    assert training_bytes(PRESETS["mini-rgbd"].settings) < 8e9
    assert training_bytes(PRESETS["big-rgbd"].settings) < 80e9


def test_the_estimate_counts_no_more_than_the_layers_put_out() -> None:
    """Oracle: hooks on the convolutions, norms and activations of a real network."""
    settings, size, counted = toy(size=64).network.generator, 64, [0]
    network = Generator(settings)
    for part in network.modules():
        if isinstance(part, (nn.Conv2d, nn.ConvTranspose2d, nn.BatchNorm2d, nn.ReLU)):
            part.register_forward_hook(lambda _, __, out: counted.__setitem__(0, counted[0] + out.numel()))
    network(torch.zeros(1, settings.in_channels, size, size))
    assert 0.3 * counted[0] < limits.KEPT * generator_numbers(settings, size) <= counted[0]
