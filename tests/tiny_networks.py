"""Tiny ONNX networks with a contract, made node by node: what they do to their planes is known in closed form."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from dlama.inpainters.networks.contract import MASKS, PLANES, Contract

NAMES = ("red", "green", "blue", "depth")


def saved(
    path: Path,
    nodes: list,
    ends: tuple[list, list],
    constants: Mapping[str, np.ndarray],
    about: Mapping[str, str] | None = None,
) -> Path:
    """An ONNX file of these nodes, inputs and outputs."""
    values = [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "tiny", *ends, values)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    if about:
        helper.set_model_props(model, about)
    onnx.save(model, str(path))
    return path


def written(
    path: Path, planes: int, matrix: np.ndarray, bias: float | np.ndarray = 0.0, about: dict | None = None, **changes
) -> Path:
    """A pointwise network: every output pixel is matrix (planes x inputs, planes + masks) times its inputs, plus bias."""
    weight = np.asarray(matrix, np.float32)[:, :, None, None]
    offset = np.broadcast_to(np.float32(bias), (planes,)).astype(np.float32)
    ends = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["b", count, "h", "w"])
        for name, count in (("planes", weight.shape[1]), ("filled", planes))
    ]
    node = helper.make_node("Conv", ["planes", "weight", "bias"], ["filled"])
    constants = {"weight": weight, "bias": offset}
    said = {**contract(planes), **changes} if about is None else about
    return saved(path, [node], (ends[:1], ends[1:]), constants, {"dlama.contract": json.dumps(said)} if said else None)


def contract(planes: int) -> dict:
    """As `dlama models convert` writes it."""
    return {
        "version": 1,
        "network": "lama",
        "in_planes": [*NAMES[:planes], "mask"],
        "out_planes": list(NAMES[:planes]),
        "in_range": [0, 1],
        "out_range": [0, 1],
        "mask": "1 = fill",
        "hole": "zero",
        "multiple": 8,
        "minimum": 16,
    }


def contract_of_planes(count: int, masks: int = 1) -> Contract:
    """One by hand, for a file without: of a network that gives 3, 4 or 6 planes and takes so many masks."""
    return Contract((*PLANES[count], *MASKS[masks]), PLANES[count])


def constant(path: Path, planes: int, *values: float, **changes) -> Path:
    """Gives these values everywhere."""
    return written(path, planes, np.zeros((planes, planes + 1)), np.array(values), **changes)


def echo_mask(path: Path, planes: int, **changes) -> Path:
    """Gives a quarter of the plane it was shown, plus half the mask it was shown: a probe of both."""
    matrix = np.concatenate([0.25 * np.eye(planes), np.full((planes, 1), 0.5)], 1)
    return written(path, planes, matrix, **changes)
