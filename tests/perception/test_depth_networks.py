"""Networks of depth and their contracts (oracles: tiny networks whose answer is known in closed form, one of each contract)."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from onnx import TensorProto, helper

from dlama.errors import FileError, InputError
from dlama.geometry.camera import Camera
from dlama.models.contracts import CONTRACT_KEY
from dlama.models.network_file import NetworkFile
from dlama.perception.depth_networks import DepthContract, DepthPrediction, predict
from dlama.perception.monocular import ESTIMATORS, estimate_depth, find_estimator
from tiny_networks import constant, saved

pytest.importorskip("onnxruntime")
WEIGHTS = np.float32([0.2, 0.3, 0.5])
COLOR = np.random.default_rng(5).integers(0, 256, (48, 64, 3), np.uint8)


def value(name: str, *shape: Any, kind: int = TensorProto.FLOAT) -> Any:
    """An input or output of a graph."""
    return helper.make_tensor_value_info(name, kind, shape)


def weighted_sum(
    path: Path, shape: tuple = (1, 3, "h", "w"), rank: int = 4, bias: float = 0.0, about: dict | None = None
) -> Path:
    """Gives WEIGHTS times the three channels it is shown, plus bias; 1 x 1 x h x w or 1 x h x w."""
    weight = {"weight": WEIGHTS[None, :, None, None], "bias": np.float32([bias]), "axis": np.array([1], np.int64)}
    nodes = [helper.make_node("Conv", ["picture", "weight", "bias"], ["sum"])]
    nodes.append(
        helper.make_node("Identity", ["sum"], ["map"])
        if rank == 4
        else helper.make_node("Squeeze", ["sum", "axis"], ["map"])
    )
    ends = (1, 1, "a", "b") if rank == 4 else (1, "a", "b")
    return saved(path, nodes, ([value("picture", *shape)], [value("map", *ends)]), weight, about)


def shown(color: np.ndarray, mean: np.ndarray, std: np.ndarray, scale: float = 1 / 255) -> np.ndarray:
    """What weighted_sum gives for a picture shown at its own size."""
    return ((color * scale - mean) / std) @ WEIGHTS.astype(float)


def test_the_picture_is_normalised_as_the_contract_says(tmp_path: Path) -> None:
    """Closed form, for the contracts of every estimator: scale, mean and std, at a size that needs no resizing."""
    for name, contract in ESTIMATORS.items():
        if contract.gives == "points":
            continue
        one = dataclasses.replace(contract, side=contract.sides[-1])
        color = np.random.default_rng(1).integers(0, 256, (contract.sides[-1], 56 * contract.multiple, 3), np.uint8)
        network = NetworkFile(weighted_sum(tmp_path / "n.onnx", bias=3))
        found = predict(network, one, color)
        expected = shown(color, np.array(contract.mean), np.array(contract.std), contract.scale) + 3
        np.testing.assert_allclose(found.values, expected, rtol=1e-4, atol=1e-4, err_msg=name)
        assert (found.gives, found.metric) == (contract.gives, contract.metric)
        assert found.notes["model"] == "n.onnx" and len(found.notes["model_sha256"]) == 64


@pytest.mark.parametrize(
    ("hw", "expected"),
    [((480, 640), (518, 686)), ((640, 480), (686, 518)), ((518, 518), (518, 518)), ((480, 848), (518, 910))],
)
def test_the_shorter_side_is_518_and_both_are_multiples_of_14(hw: tuple[int, int], expected: tuple[int, int]) -> None:
    """Oracle: the sizes that the published preprocessor of Depth Anything V2 gives (518, lower bound, multiple of 14)."""
    contract = ESTIMATORS["depth-anything-small"]
    assert contract.input_sizes(hw) == [expected]
    assert contract.tensor(np.zeros((*hw, 3), np.uint8), expected).shape == (1, 3, *expected)


@pytest.mark.parametrize("hw", [(2, 3000), (8000, 100), (500, 4000)])
def test_a_strip_is_shown_no_larger_than_a_panorama(hw: tuple[int, int]) -> None:
    """Law: the area is that of a picture of 4:1 at most (memory grows with it: 2 x 3000 pixels took more than there was)."""
    contract = ESTIMATORS["tcmonodepth"]
    sizes = contract.input_sizes(hw)
    assert all(height * width <= 4 * side**2 for (height, width), side in zip(sizes, contract.sides))
    assert all(max(size) == 4 * side for size, side in zip(sizes, contract.sides))


@pytest.mark.parametrize("metric", [False, True])
def test_predictions_at_several_sides_are_averaged(tmp_path: Path, metric: bool) -> None:
    """Closed form: of a picture whose left half is 50 and right half is 150, shown at 24 and 48 rows, the mean of both maps is
    the map of one; relative maps are divided by their means, 100 here. A side whose size is another's counts once."""
    color = np.full((48, 96, 3), 50, np.uint8)
    color[:, 48:] = 150
    contract = DepthContract("depth", metric=metric, scale=1.0, side=(24, 48, 49), multiple=8)
    assert contract.input_sizes((48, 96)) == [(24, 48), (48, 96)]
    found = predict(NetworkFile(weighted_sum(tmp_path / "n.onnx")), contract, color).values
    assert found.shape == (48, 96)
    np.testing.assert_allclose(
        found[:, [0, -1]], np.broadcast_to([50, 150], (48, 2)) / (1 if metric else 100), rtol=1e-5
    )


def test_a_graph_of_one_size_is_shown_the_picture_stretched_to_it(tmp_path: Path) -> None:
    """Closed form, whatever sides the contract names: the network's answer to the stretched picture."""
    contract = DepthContract("depth", metric=True, scale=1.0, side=(128, 192), multiple=16)
    network = NetworkFile(weighted_sum(tmp_path / "n.onnx", (1, 3, 24, 32)))
    expected = shown(cv2.resize(COLOR, (32, 24), interpolation=cv2.INTER_AREA), np.zeros(3), np.ones(3), 1)
    np.testing.assert_allclose(predict(network, contract, COLOR).values, expected, rtol=1e-4)


def test_both_ranks(tmp_path: Path) -> None:
    """Law: 1 x h x w is taken like 1 x 1 x h x w."""
    contract = DepthContract("inverse depth", side=48, multiple=16)
    three, four = (
        predict(NetworkFile(weighted_sum(tmp_path / f"{rank}.onnx", rank=rank)), contract, COLOR) for rank in (3, 4)
    )
    np.testing.assert_array_equal(three.values, four.values)


def point_network(path: Path, points: np.ndarray, mask: np.ndarray, scale: float, names: tuple[str, ...]) -> Path:
    """Gives the same points, mask and metric scale whatever it sees, and takes a number of tokens as MoGe does."""
    constants = {"p": points[None].astype(np.float32), "m": mask[None].astype(np.float32), "s": np.float32([scale])}
    nodes = [helper.make_node("Identity", [key], [name]) for key, name in zip("pms", names)]
    inputs = [value("image", 1, 3, "h", "w"), value("num_tokens", kind=TensorProto.INT64)]
    ends = [value(names[0], 1, *points.shape), value(names[1], 1, *mask.shape), value(names[2], 1)]
    return saved(path, nodes, (inputs, ends), constants)


@pytest.mark.parametrize(("last", "given"), [("metric_scale", False), ("scale", True)])
def test_points_come_with_sky_scale_and_field_of_view(tmp_path: Path, last: str, given: bool) -> None:
    """Closed form: points of a slanted plane at half their metric size, z shifted; where the mask says no it is sky. A given
    camera is kept."""
    camera = Camera.from_fov(64, 48, 70)
    rows, columns = np.mgrid[:48, :64]
    z = 1 / (0.1 + 0.004 * rows)
    x, y = (columns + 0.5 - camera.cx) / camera.fx * z, (rows + 0.5 - camera.cy) / camera.fy * z
    mask = rows >= 5
    points = np.stack([x, y, z - 2], 2) / 2
    points[~mask] = np.inf
    path = point_network(tmp_path / "p.onnx", points, mask, 2.0, ("points", "mask", last))
    found = estimate_depth(COLOR, camera if given else None, depth_model=f"moge-small={path}", sharpen=False)
    np.testing.assert_allclose(found.depth[mask], z[mask], rtol=2e-3)
    assert np.isposinf(found.depth[~mask]).all()
    assert found.camera.fx == pytest.approx(camera.fx, rel=2e-3) and (found.camera is camera) == given
    assert found.meta["gives"] == "metric points"
    own = DepthPrediction(
        (2 * points).astype(np.float32), "points", True
    )  # as MoGe's own code gives them, without the mask
    again = estimate_depth(COLOR, camera if given else None, depth_model=lambda _: own, sharpen=False)
    np.testing.assert_array_equal(again.depth, found.depth)
    assert found.meta["field_of_view"]["from"] == ("given" if given else "the network")


def test_a_file_tells_its_contract(tmp_path: Path) -> None:
    """Round trip through the file's metadata."""
    contract = DepthContract("depth", metric=True, mean=(0.5, 0.4, 0.3), side=392, outputs=("map|depth",))
    file = NetworkFile(weighted_sum(tmp_path / "c.onnx", about=contract.metadata()))
    assert DepthContract.of_file(file) == contract
    assert DepthContract.of_file(NetworkFile(weighted_sum(tmp_path / "n.onnx"))) is None


def test_the_contract_of_the_docs_is_one(tmp_path: Path) -> None:
    """The page's JSON; a file that carries it runs (oracle: the network's closed form)."""
    page = (Path(__file__).parents[2] / "docs" / "models.md").read_text("utf-8")
    (text,) = (block for block in re.findall(r"```json\n(.*?)```", page, re.DOTALL) if "monocular depth" in block)
    contract = DepthContract.read(text, Path("models.md"))
    assert (contract.gives, contract.metric, contract.side, contract.multiple) == ("inverse depth", False, 518, 14)
    file = weighted_sum(tmp_path / "mine.onnx", about={CONTRACT_KEY: text})
    assert find_estimator(str(file))[1](COLOR).gives == "inverse depth"


def test_files_with_another_contract_get_one_line(tmp_path: Path) -> None:
    """Law: the file, what came and what was expected."""
    plain = weighted_sum(tmp_path / "plain.onnx")
    for model, reported in (
        (
            constant(tmp_path / "lama.onnx", 3, 0, 0, 0),
            r"lama\.onnx: is a network 'lama' by its contract; monocular depth",
        ),
        (plain, r"plain\.onnx: carries no contract .*depth_model=NAME=plain\.onnx, NAME of tcmonodepth"),
        (
            f"tcmonodepth={weighted_sum(tmp_path / 'small.onnx', (1, 4, 100, 100))}",
            "4 x 100 x 100.*1 x 3 x 100 x 100 is expected",
        ),
        (f"moge-small={plain}", "a float picture of 1 x 3 x .* and a number of tokens is expected"),
        (f"tcmonodepth={weighted_sum(tmp_path / 'nan.onnx', bias=float('nan'))}", "values that are not finite"),
        (tmp_path / "none.onnx", "no such model file"),
        ("tcmonodepth=none.onnx", r"none\.onnx: no such model file"),
    ):
        with pytest.raises(InputError, match=reported):
            estimate_depth(COLOR, Camera.from_fov(64, 48, 60), depth_model=model)
    names = ("points", "mask", "height")
    other = point_network(tmp_path / "p.onnx", np.ones((48, 64, 3)), np.ones((48, 64)), 1, names)
    with pytest.raises(FileError, match=r"gives points, mask, height; metric_scale\|scale is expected"):
        find_estimator(f"moge-small={other}")[1](COLOR)
    pair = point_network(tmp_path / "q.onnx", np.ones((48, 64, 2)), np.ones((48, 64)), 1, ("points", "mask", "scale"))
    with pytest.raises(FileError, match="gave an output of 1 x 48 x 64 x 2; 1 x h x w x 3 is expected"):
        find_estimator(f"moge-small={pair}")[1](COLOR)


@pytest.mark.parametrize(
    ("changes", "reported"),
    [
        ({"gives": "disparity"}, "gives is 'disparity'; one of depth, inverse depth, points"),
        ({"std": (1.0, 0.0, 1.0)}, "std and scale above 0"),
        ({"multiple": 0}, "side and multiple of 1 or more"),
        ({"side": ()}, "side and multiple of 1 or more"),
        ({"side": (24, 48), "gives": "points"}, "2 sides are for one map"),
    ],
)
def test_contracts_that_cannot_be(changes: dict[str, Any], reported: str) -> None:
    """Law: refused when made."""
    with pytest.raises(InputError, match=reported):
        DepthContract(**{"gives": "depth", **changes})


def test_a_contract_of_other_types_is_refused() -> None:
    """Law: a field is of the type that its contract says ("false" of a hand-written one was true, and gave metres)."""
    text = '{"network": "monocular depth", "gives": "depth", "metric": "false"}'
    with pytest.raises(FileError, match=r"mine\.json: metric is of type str; True or False is expected"):
        DepthContract.read(text, Path("mine.json"))
