"""Everybody's file of the same weights gives the same network, and half of one is refused."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import torch

from dlama.errors import FileError
from dlama.nets.architecture import DiscriminatorSettings, GeneratorSettings
from dlama.nets.checkpoints import read_generator
from dlama.nets.generator import Discriminator, generator_from_state
from dlama.nets.safetensors_file import write_safetensors

SMALL = GeneratorSettings(width=8, blocks=1)
SPLIT, NOTHING = "model.4.ffc.convl2{}.weight", np.zeros((0, 32, 3, 3), np.float32)


def _same(state, other) -> None:
    assert list(state) == list(other)
    for name, array in other.items():
        np.testing.assert_array_equal(state[name], array)
        assert state[name].dtype == array.dtype


def test_the_vector_file_itself(vector_file, generator_vector):
    """Oracle: the published code's tensors; what is next to them is named and left."""
    weights = read_generator(vector_file)
    assert weights.settings == GeneratorSettings(4, 3, 8, 3, 2) and weights.kind == "safetensors"
    assert set(weights.state) == set(generator_vector[0])
    assert weights.notes == ("left in the file: 1 tensors of input, 1 tensors of output",)


class Callback:
    """Of a trainer that is not installed: a class the reader must never import."""

    def __init__(self) -> None:
        self.best = {"path": "epoch=40.ckpt", "scores": [1.0, 2.0]}


def test_official_lightning_checkpoint(tmp_path, random_state):
    """Oracle: the same weights; built as the published file is, with everything a trainer of 2021 leaves in it."""
    state, judge = random_state(SMALL), Discriminator(DiscriminatorSettings(3, 8, 3)).state_dict()
    tensors = {f"generator.{name}": torch.from_numpy(array) for name, array in state.items()}
    tensors |= {f"discriminator.{name}": tensor for name, tensor in judge.items()}
    tensors["loss_resnet_pl.impl.conv1.weight"] = torch.full((2, 2), float("nan"))
    contents = {
        "epoch": 40, "global_step": 1000, "pytorch-lightning_version": "1.2.9", "state_dict": tensors,
        "callbacks": {Callback: Callback()}, "hparams": Callback(),
        "optimizer_states": [{"state": {0: {"exp_avg": torch.zeros(4)}}, "param_groups": []}],
    }  # fmt: skip
    torch.save(contents, tmp_path / "best.ckpt")
    weights = read_generator(tmp_path / "best.ckpt")
    _same(weights.state, state)
    assert weights.kind == "lightning" and weights.settings == SMALL
    assert weights.notes == (
        "left in the file: 25 tensors of discriminator, 1 tensors of loss_resnet_pl, epoch, global_step, "
        "pytorch-lightning_version, callbacks, hparams, optimizer_states",
    )


def test_torchscript_archive(tmp_path, random_state):
    """Oracle: the same weights; names under model.generator, as in the archive everybody passes around."""

    class Model(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.generator = generator_from_state(random_state(SMALL))

        def forward(self, x):
            return self.generator(x)

    class Wrapper(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.model = Model()

        def forward(self, image, mask):
            return self.model(torch.cat([image * (1 - mask), mask], dim=1))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        traced = torch.jit.trace(Wrapper(), (torch.rand(1, 3, 32, 32), torch.rand(1, 1, 32, 32)), check_trace=False)
        torch.jit.save(traced, str(tmp_path / "big-lama.pt"))
    weights = read_generator(tmp_path / "big-lama.pt")
    assert weights.kind == "torchscript" and weights.notes == ()
    _same(weights.state, random_state(SMALL))


@pytest.mark.parametrize("prefix", ["", "generator.", "model.generator."])
def test_any_prefix(tmp_path, random_state, prefix):
    """Oracle: the same weights."""
    path = tmp_path / "w.safetensors"
    write_safetensors(
        path, {prefix + name: array for name, array in random_state(SMALL).items()}, {"activation": "tanh"}
    )
    weights = read_generator(path)
    _same(weights.state, random_state(SMALL))
    assert weights.settings.activation == "tanh"


def test_the_moving_average_is_meant(tmp_path, random_state):
    """Oracle: the weights under average, as of a checkpoint of dlama's training, which exports them; the generator's are left."""
    state = random_state(SMALL)
    others = {f"generator.{name}": array * 0 for name, array in state.items()}
    write_safetensors(tmp_path / "w.safetensors", others | {f"average.{name}": array for name, array in state.items()})
    weights = read_generator(tmp_path / "w.safetensors")
    _same(weights.state, state)
    assert weights.notes == (f"left in the file: {len(state)} tensors of generator",)


def test_half_precision_is_converted_and_said(tmp_path, random_state):
    """Oracle: numpy's own rounding to float16; bfloat16 through torch."""
    state = random_state(SMALL)
    halves = {name: array.astype(np.float16) if array.dtype == np.float32 else array for name, array in state.items()}
    write_safetensors(tmp_path / "w.safetensors", halves)
    weights = read_generator(tmp_path / "w.safetensors")
    floats = sum(array.dtype == np.float32 for array in state.values())
    assert weights.notes == (f"{floats} tensors of F16 were converted to float32",)
    for name, array in halves.items():
        assert weights.state[name].dtype == (np.float32 if array.dtype == np.float16 else np.int64)
        np.testing.assert_array_equal(weights.state[name], array)
    brains = {name: torch.from_numpy(array).bfloat16() if array.ndim else torch.from_numpy(array)
              for name, array in state.items()}  # fmt: skip
    torch.save(brains, tmp_path / "w.pth")
    weights = read_generator(tmp_path / "w.pth")
    assert weights.notes == (f"{floats} tensors of BF16 were converted to float32",)
    for name, tensor in brains.items():
        np.testing.assert_array_equal(weights.state[name], tensor.float().numpy() if tensor.ndim else tensor.numpy())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda s: s["model.4.bn_g.bias"].fill(np.nan),
            r"model\.4\.bn_g\.bias holds 48 numbers that are NaN or infinite",
        ),
        (lambda s: s["model.4.bn_g.running_var"].fill(-1), r"model\.4\.bn_g\.running_var holds negative variances"),
        (
            lambda s: s.update({"model.4.bn_g.bias": s["model.4.bn_g.bias"].astype(np.int32)}),
            r"model\.4\.bn_g\.bias holds I32, expected floating point",
        ),
        (lambda s: s.pop("model.4.bn_g.bias"), r"1 missing: model\.4\.bn_g\.bias"),
        (
            lambda s: s.update({"model.4.bn_g.bias": np.zeros(47, np.float32)}),
            r"model\.4\.bn_g\.bias is 47, expected 48",
        ),
        (lambda s: s.update({"model.17.weight": np.zeros(3, np.float32)}), "shape 3, expected 4 dimensions"),
        (lambda s: s.update({"extra": np.zeros(1, np.float32)}), "1 not part of it: extra"),
        (
            lambda s: s.pop("model.1.ffc.convl2l.weight"),
            r"no tensor is called model\.1\.ffc\.convl2l\.weight; the first",
        ),
        (
            lambda s: s.update(dict.fromkeys((SPLIT.format("l"), SPLIT.format("g")), NOTHING)),
            "0 of 64 channels are global",
        ),
        (lambda s: s.update({"ema.model.1.ffc.convl2l.weight": s["model.1.ffc.convl2l.weight"]}), "2 networks have"),
    ],
)
def test_files_that_are_no_generator(tmp_path, random_state, change, message):
    """Oracle: the change itself; the message begins with the file."""
    state = random_state(SMALL)
    change(state)
    write_safetensors(tmp_path / "w.safetensors", state)
    with pytest.raises(FileError, match=rf"w\.safetensors: .*({message})"):
        read_generator(tmp_path / "w.safetensors")


def test_counters_may_be_absent(tmp_path, random_state):
    """Oracle: they play no part in eval mode; it is said."""
    state = {name: array for name, array in random_state(SMALL).items() if array.ndim}
    write_safetensors(tmp_path / "w.safetensors", state)
    weights = read_generator(tmp_path / "w.safetensors")
    assert weights.notes[0].endswith("batch-norm counters are absent and were set to 0")
    _same(weights.state, random_state(SMALL))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (None, "no such file"),
        (b"", "neither a torch archive nor safetensors"),
        (b"<html>not found</html>", "neither a torch archive nor safetensors"),
        (b"\x80\x02}q\x00.", "a bare pickle"),
        (b"PK\x03\x04" + bytes(100), "not a torch archive"),
        (b"\xff\x00\x00\x00\x00\x00\x00\x00{}", "truncated"),
    ],
)
def test_files_that_are_nothing(tmp_path, data, message):
    """Oracle: the file itself."""
    path = tmp_path / "w.pt"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(FileError, match=rf"w\.pt: {message}"):
        read_generator(path)
