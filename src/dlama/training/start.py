"""Network settings in -> the generator a run starts from, out: new weights, or anybody's LaMa with planes added."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from dlama.errors import InputError
from dlama.nets.checkpoints import read_generator
from dlama.nets.generator import Generator, generator_from_state
from dlama.nets.surgery import widen
from dlama.training.settings import NetworkSettings


def started(network: NetworkSettings) -> Generator:
    """The generator in train mode; new weights are drawn from torch's current random numbers.

    Raises:
        FileError: `network.start` is no file with one generator in it.
        InputError: it is another network than the settings describe, planes apart.
    """
    if network.start is None:
        return Generator(network.generator)
    weights = read_generator(Path(network.start).expanduser())
    had = replace(
        weights.settings, in_channels=network.generator.in_channels, out_channels=network.generator.out_channels
    )
    if had != network.generator:
        raise InputError(f"{network.start}: is {weights.settings}; the settings say {network.generator}")
    state = widen(weights.state, network.generator.in_channels, network.generator.out_channels)
    return generator_from_state(state).train()
