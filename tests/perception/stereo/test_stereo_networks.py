"""Networks of stereo matching, made node by node: what they give of a pair is known in closed form."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto, helper

from dlama.errors import FileError, InputError
from dlama.perception.stereo.consistency import transfer_disparity
from dlama.perception.stereo.networks import NetworkMatcher, StereoContract
from tiny_networks import saved

SHIFT = 6


def tiny(path: Path, contract: StereoContract | None, factor: float = 1.0) -> Path:
    """Gives the left picture's red plane times `factor` as flow; a coarse output comes first, as of RAFT-Stereo."""
    ends = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, planes, "h", "w"])
        for name, planes in (("left", 3), ("right", 3), ("coarse", 1), ("flow", 1))
    ]
    weight = np.zeros((1, 3, 1, 1), np.float32)
    weight[0, 0] = factor
    nodes = [
        helper.make_node("Conv", ["right", "weight"], ["coarse"]),
        helper.make_node("Conv", ["left", "weight"], ["flow"]),
    ]
    about = None if contract is None else contract.metadata()
    return saved(path, nodes, (ends[:2], ends[2:]), {"weight": weight}, about)


def pair(hw: tuple[int, int] = (40, 70)) -> tuple[np.ndarray, np.ndarray]:
    """Pictures whose red plane says SHIFT everywhere: the network takes it for the disparity."""
    picture = np.full((*hw, 3), 50, np.uint8)
    picture[..., 0] = SHIFT
    return picture, picture.copy()


def test_the_contract_says_what_the_numbers_mean(tmp_path: Path) -> None:
    """Closed form: sign, normalisation, scale of the output and padding come from the file; what leaves the picture is 0."""
    left, right = pair()
    for contract, factor in (
        (StereoContract(), 1.0),
        (StereoContract(sign=-1), -1.0),
        (StereoContract(scale=1 / 255, output_scale=255.0), 1.0),
        (StereoContract(mean=(1, 0, 0), std=(0.5, 1, 1), output="flow"), SHIFT / (2 * (SHIFT - 1))),
        (StereoContract(multiple=16), 1.0),
    ):
        matcher = NetworkMatcher.open(tiny(tmp_path / "n.onnx", contract, factor))
        at_left, at_right = matcher(left, right)
        np.testing.assert_allclose(at_left[:, SHIFT:], SHIFT, rtol=1e-5)
        np.testing.assert_allclose(at_right[:, :-SHIFT], SHIFT, rtol=1e-5)
        assert not at_left[:, :SHIFT].any() and not at_right[:, -SHIFT:].any()
        assert matcher.file.notes["model"] == "n.onnx"


def test_a_network_of_one_size(tmp_path: Path) -> None:
    """Closed form: pictures stretched to half their width; what it gives counts twice, in the pictures' pixels."""
    matcher = NetworkMatcher.open(tiny(tmp_path / "n.onnx", StereoContract(size=(20, 35))))
    at_left, _ = matcher(*pair())
    np.testing.assert_allclose(at_left[:, 2 * SHIFT :], 2 * SHIFT, rtol=1e-5)


def test_the_contract_may_lie_next_to_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Round trip, also from a user's home; without one, or with a wrong one, the file is refused by name."""
    monkeypatch.setenv("HOME", str(tmp_path))
    path = tiny(tmp_path / "raft.onnx", None, -1.0)
    with pytest.raises(FileError, match=r"raft\.onnx: carries no contract.*raft\.json"):
        NetworkMatcher.open(path)
    (tmp_path / "raft.json").write_text(json.dumps({"network": "stereo matching", "sign": -1}))
    np.testing.assert_allclose(NetworkMatcher.open("~/raft.onnx")(*pair())[0][:, SHIFT:], SHIFT)
    for words, reported in (
        ({"network": "lama"}, "'lama' by its contract"),
        ({"network": "stereo matching", "colour": 1}, "its contract has colour"),
        ({"network": "stereo matching", "sign": 2}, "sign is 2"),
        ([1], "cannot be read"),
    ):
        (tmp_path / "raft.json").write_text(json.dumps(words))
        with pytest.raises(FileError, match=reported):
            NetworkMatcher.open(path)


def test_what_does_not_keep_its_contract(tmp_path: Path) -> None:
    """Law: a name that is not given, and numbers that are none, are errors with the file's name."""
    with pytest.raises(FileError, match=r"n\.onnx: gives coarse, flow; its contract wants up"):
        NetworkMatcher.open(tiny(tmp_path / "n.onnx", StereoContract(output="up")))(*pair())
    with pytest.raises(FileError, match="finite"):
        NetworkMatcher.open(tiny(tmp_path / "n.onnx", StereoContract(), float("nan")))(*pair())
    with pytest.raises(InputError, match="output_scale"):
        StereoContract(output_scale=0)


def test_the_right_disparity_of_a_given_left_one() -> None:
    """Closed form: a square 12 px before a wall at 4 px; the nearest wins, and what only the right camera sees is unknown."""
    left = np.full((10, 60), 4, np.float32)
    left[2:8, 30:40] = 12
    left[:, 5] = 0
    right = transfer_disparity(left)
    assert (right[2:8, 18:28] == 12).all() and (right[0, 2:56] == 4).all()
    assert (right[2:8, 28:36] == 0).all() and (right[:, 56:] == 0).all()
