"""Settings of a run in -> InputError out, before any work, where this machine has not the devices or the memory for them.

What is needed is estimated from below (weights, optimisers, and the tensors that the backward pass keeps), so that nothing is
refused that fits.
"""

from __future__ import annotations

import torch

from dlama.completion.memory import GB, available_bytes
from dlama.errors import InputError
from dlama.models.network_file import processor_count
from dlama.nets.architecture import GeneratorSettings, count_parameters, discriminator_shapes
from dlama.training.settings import TrainSettings

GENERATOR_COPIES, DISCRIMINATOR_COPIES = 8, 7
"""Weights, gradients, two moments of Adam and the guard's copy of all but gradients; the generator's moving average, once."""
KEPT = 3
"""Tensors that the backward pass keeps of a layer: what the convolution, the norm and the activation were given."""


def check_machine(settings: TrainSettings) -> None:
    """Raise InputError for more devices than there are, and for settings whose memory cannot fit."""
    check_devices(settings)
    check_memory(settings)


def check_devices(settings: TrainSettings) -> None:
    """Raise InputError for more GPUs or, on a CPU, more processes than this computer has."""
    asked, (there, what) = settings.loop.devices, _devices(settings)
    if asked > there:
        raise InputError(f"`loop.devices` is {asked}; this computer has {there} {what}, so at most {there} is expected")


def check_memory(settings: TrainSettings) -> None:
    """Raise InputError where the settings' networks and batch take more memory than is there."""
    gpu = _devices(settings)[1] == "GPUs"
    free = torch.cuda.get_device_properties(0).total_memory if gpu else available_bytes()
    needed = training_bytes(settings) * (1 if gpu else settings.loop.devices)
    if free is not None and needed > free:
        s = settings
        raise InputError(
            f"`network.width` {s.network.width}, data.size {s.data.size} and `loop.batch` {s.loop.batch} take at least "
            f"{needed / GB:.1f} GB of memory{' on each GPU' if gpu else ''}, {free / GB:.1f} GB are "
            f"{'there' if gpu else 'free'}; make one of them smaller"
        )


def training_bytes(settings: TrainSettings) -> float:
    """Bytes that one process takes at least for its networks, optimisers and one step."""
    net, loop, size = settings.network, settings.loop, settings.data.size
    copies = GENERATOR_COPIES * net.parameters
    if settings.loss.uses_discriminator:
        copies += DISCRIMINATOR_COPIES * count_parameters(discriminator_shapes(net.discriminator))
    width = 2 if loop.precision == "bf16" else 4
    planes = 4.0 * size * size * (net.generator.in_channels + net.generator.out_channels)
    step = width * KEPT * generator_numbers(net.generator, size) + planes
    return 4.0 * copies + loop.batch * step + settings.data.held_out * planes


def generator_numbers(s: GeneratorSettings, size: int) -> float:
    """Numbers that the layers of a generator put out for one picture of size x size pixels."""
    pixels = float(size * size)
    levels = sum(s.channels_at(level) * pixels / 4**level for level in range(s.downsamplings + 1))
    return 2 * levels + 2 * s.blocks * s.channels_at(s.downsamplings) * pixels / 4**s.downsamplings


def _devices(settings: TrainSettings) -> tuple[int, str]:
    """How many devices there are of the kind that the settings ask for, and what they are called."""
    if settings.loop.accelerator == "cpu":
        return processor_count(), "processor cores"
    gpus = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if gpus or settings.loop.accelerator == "gpu":
        return gpus, "GPUs"
    return processor_count(), "processor cores"
