"""Torch archives are read without torch and without ever running what a pickle asks for."""

from __future__ import annotations

import io
import os
import pickle
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from dlama.errors import FileError
from dlama.nets.torch_file import TorchFile


def _archive(
    path: Path, pickled: bytes, entries: dict[str, bytes] | None = None, how: int = zipfile.ZIP_STORED
) -> Path:
    with zipfile.ZipFile(path, "w", how) as archive:
        for name, data in {"archive/data.pkl": pickled, **(entries or {})}.items():
            archive.writestr(name, data)
    return path


class Exploit:
    """Runs a shell command when an ordinary unpickler meets it."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch {self.marker}",)


def test_an_exploit_is_inert_and_the_weights_next_to_it_are_read(tmp_path):
    """Oracle: the marker file; and the guard can fail: the standard unpickler runs the very same object."""
    marker = tmp_path / "ran"
    weights = torch.rand(3, 4)
    contents = {"state_dict": {"generator.w": weights}, "callbacks": {Exploit: Exploit(marker)}, "epoch": 3}
    torch.save(contents, tmp_path / "evil.ckpt")
    file = TorchFile(tmp_path / "evil.ckpt")
    assert file.kind == "lightning" and file.others == ("callbacks", "epoch")
    np.testing.assert_array_equal(file.read(["generator.w"])["generator.w"][0], weights.numpy())
    assert not marker.exists()
    pickle.loads(pickle.dumps(Exploit(marker)))
    assert marker.exists()


def _attacks(command: str) -> dict[str, bytes]:
    """The ways a pickle has to call something, written as opcodes."""
    text = command.encode()
    return {
        "reduce": b"cos\nsystem\n(V" + text + b"\ntR.",
        "inst": b"(V" + text + b"\nios\nsystem\n.",
        "obj": b"(cos\nsystem\nV" + text + b"\no.",
        "newobj": b"\x80\x02csubprocess\nPopen\n(V" + text + b"\nt\x81.",
        "newobj_ex": b"\x80\x04csubprocess\nPopen\n(V" + text + b"\nt}\x92.",
        "stack global": b"\x80\x04\x8c\x08builtins\x8c\x04eval\x93(V__import__('os').system('" + text + b"')\ntR.",
        "dotted": b"\x80\x04\x8c\x05torch\x8c\x09os.system\x93(V" + text + b"\ntR.",
        "build": b"cos\nsystem\n)R}V__setstate__\ncos\nsystem\nsbV" + text + b"\nb.",
        "getattr": b"cbuiltins\ngetattr\n(cos\n__dict__\nVsystem\ntR(V" + text + b"\ntR.",
        "rebuilder": b"ctorch._utils\n_rebuild_tensor_v2\n}V__call__\ncos\nsystem\nsb(V" + text + b"\ntR.",
    }


@pytest.mark.parametrize("way", list(_attacks("")))
def test_no_opcode_runs_anything(tmp_path, way):
    """Oracle: the marker file, for each opcode that can call; inside a table, so that the file is read to the end."""
    marker = tmp_path / "ran"
    attack = _attacks(f"touch {marker}")[way].removeprefix(b"\x80\x02").removeprefix(b"\x80\x04")[:-1]
    path = _archive(tmp_path / "evil.pt", b"\x80\x04}V" + b"callbacks\n" + attack + b"s.")
    if way == "rebuilder":
        with pytest.raises(FileError, match="its pickle cannot be read"):
            TorchFile(path)
    else:
        assert TorchFile(path).tensors == {}
    assert not marker.exists()


def test_the_interpreter_is_left_alone(tmp_path):
    """Oracle: law; a pickle that sets an item of os.environ reaches a placeholder only."""
    with pytest.raises(FileError, match="its pickle cannot be read"):
        TorchFile(_archive(tmp_path / "evil.pt", b"}Va\ncos\nenviron\nVDLAMA_PWNED\nV1\nss."))
    assert "DLAMA_PWNED" not in os.environ


def test_a_zip_that_is_no_archive(tmp_path):
    """Oracle: the file itself."""
    with zipfile.ZipFile(tmp_path / "pictures.zip", "w") as archive:
        archive.writestr("photo.png", b"...")
    with pytest.raises(FileError, match="a ZIP, but no torch archive: 0 entries"):
        TorchFile(tmp_path / "pictures.zip")


def _tensor_pickle(numel: int, offset: int, shape: tuple[int, ...], strides: tuple[int, ...]) -> bytes:
    """Opcodes of {"w": _rebuild_tensor_v2(storage "0", offset, shape, strides)}."""

    def ints(values: tuple[int, ...]) -> bytes:
        return b"(" + b"".join(b"J" + struct.pack("<i", value) for value in values) + b"t"

    pid = b"(Vstorage\nctorch\nFloatStorage\nV0\nVcpu\nJ" + struct.pack("<i", numel) + b"tQ"
    head = b"\x80\x02}Vw\nctorch._utils\n_rebuild_tensor_v2\n("
    return head + pid + b"J" + struct.pack("<i", offset) + ints(shape) + ints(strides) + b"tRs."


def test_strides_and_offsets_are_honoured(tmp_path):
    """Oracle: numpy's own views; a transposed part of a larger storage."""
    flat = np.arange(20, dtype=np.float32)
    pickled = _tensor_pickle(20, 2, (3, 4), (1, 4))
    path = _archive(tmp_path / "w.pth", pickled, {"archive/data/0": flat.tobytes()})
    array, code = TorchFile(path).read(["w"])["w"]
    assert code == "F32"
    np.testing.assert_array_equal(array, flat[2:18].reshape(4, 4)[:, :3].T)


@pytest.mark.parametrize(
    ("offset", "shape", "strides", "message"),
    [
        (0, (3, 4), (4, 1), "does not fit into its storage of 8 numbers"),
        (6, (4,), (1,), "does not fit into its storage"),
        (0, (30000, 30000), (0, 0), "does not fit into its storage"),
        (-1, (2,), (1,), "no counts"),
        (0, (2,), (-1,), "no counts"),
        (0, (2, 2), (1,), "no counts"),
    ],
)
def test_tensors_outside_their_storage_are_refused(tmp_path, offset, shape, strides, message):
    """Oracle: the storage's size."""
    path = _archive(tmp_path / "w.pth", _tensor_pickle(8, offset, shape, strides), {"archive/data/0": bytes(32)})
    with pytest.raises(FileError, match=message):
        TorchFile(path).read(["w"])


def test_missing_storages_and_compressed_ones_are_refused(tmp_path):
    """Oracle: what the archive lacks."""
    pickled = _tensor_pickle(2, 0, (2,), (1,))
    with pytest.raises(FileError, match="entry archive/data/0 cannot be read"):
        TorchFile(_archive(tmp_path / "w.pth", pickled)).read(["w"])
    with pytest.raises(FileError, match="is compressed, which torch never does"):
        TorchFile(_archive(tmp_path / "c.pth", pickled, {"archive/data/0": bytes(8)}, zipfile.ZIP_DEFLATED))
    with pytest.raises(FileError, match="big-endian"):
        TorchFile(_archive(tmp_path / "b.pth", pickled, {"archive/byteorder": b"big"}))


@pytest.mark.parametrize("pickled", [b"", b"\x80\x02}", b"garbage", b"\x80\x02]q\x00.", b"\x80\x02}VK\nV0\ns."[:-3]])
def test_broken_pickles_are_refused(tmp_path, pickled):
    """Oracle: the break itself."""
    with pytest.raises(FileError, match=r"its pickle cannot be read|expected a table"):
        TorchFile(_archive(tmp_path / "w.pth", pickled))


def test_deep_and_circular_objects_end(tmp_path):
    """Oracle: it returns; a table 50000 deep and a table that holds itself."""
    deep = b"\x80\x02" + b"}Va\n" * 50000 + b"}" + b"s" * 50000 + b"."
    assert TorchFile(_archive(tmp_path / "deep.pt", deep)).tensors == {}
    loop = io.BytesIO()
    table: dict[str, Any] = {}
    table["self"] = table
    pickle.Pickler(loop, 2).dump(table)
    assert TorchFile(_archive(tmp_path / "loop.pt", loop.getvalue())).tensors == {}


@pytest.mark.parametrize("kind", ["float64", "float16", "bfloat16", "int64", "uint8", "bool"])
def test_every_dtype_comes_back(tmp_path, kind):
    """Oracle: torch's own numbers."""
    tensor = (torch.rand(3, 5) * 9).to(getattr(torch, kind))
    torch.save({"w": tensor.T, "p": torch.nn.Parameter(tensor.float())}, tmp_path / "w.pth")
    file = TorchFile(tmp_path / "w.pth")
    array, _ = file.read(["w"])["w"]
    np.testing.assert_array_equal(array, (tensor.T.float() if kind == "bfloat16" else tensor.T).numpy())
    assert file.kind == "torch" and set(file.tensors) == {"w", "p"}


def test_a_module_that_was_pickled_whole_is_read(tmp_path):
    """Oracle: the module's own state dict; its class is never imported."""
    net = torch.nn.Sequential(torch.nn.Conv2d(2, 3, 1), torch.nn.BatchNorm2d(3))
    torch.save(net, tmp_path / "net.pth")
    file = TorchFile(tmp_path / "net.pth")
    read = file.read(list(file.tensors))
    assert set(read) == set(net.state_dict())
    for name, tensor in net.state_dict().items():
        np.testing.assert_array_equal(read[name][0], tensor.numpy())


@pytest.mark.parametrize(
    "pickled",
    [
        b"\x80\x02]" + b"}" * 5_000_000 + b".",
        b"\x80\x02ctorch._utils\n_rebuild_tensor_v2\n((Vstorage\nctorch\nFloatStorage\nV0\nVcpu\nK\x01tQ"
        b"K\x00K\x01\x85K\x01\x85tR}Vshape\nNsb.",
    ],
    ids=["5 MB", "a tensor whose state is replaced"],
)
def test_pickles_that_no_checkpoint_has_are_refused(tmp_path: Path, pickled: bytes) -> None:
    """Oracle: law; a shape that was checked is not replaced afterwards."""
    with pytest.raises(
        FileError, match=r"its pickle cannot be read \(UnpicklingError: (5000004 bytes|a tensor with a state)"
    ):
        TorchFile(_archive(tmp_path / "bomb.pt", pickled))


def test_tied_weights_are_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: round trip of two tensors that share a storage, with a third between them in name; the entries that are read."""
    weights = torch.rand(100, 100)
    torch.save({"a": weights, "aa": torch.zeros(3), "b": weights.T}, tmp_path / "tied.pt")
    file, entry, entries = TorchFile(tmp_path / "tied.pt"), TorchFile._entry, []
    monkeypatch.setattr(TorchFile, "_entry", lambda self, *of: (entries.append(of[-1]), entry(self, *of))[1])
    found = file.read(["a", "aa", "b"])
    assert list(found) == ["a", "aa", "b"] and len(entries) == len(set(entries)) == 2
    np.testing.assert_array_equal(found["a"][0], weights.numpy())
    np.testing.assert_array_equal(found["b"][0], weights.numpy().T)
