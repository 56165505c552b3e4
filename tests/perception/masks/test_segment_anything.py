"""The masker segment-anything on tiny ONNX pairs with the inputs and outputs of SAM, MobileSAM and EfficientSAM.

The tiny encoder only counts as one (its embedding is a mean of what it is shown); the tiny decoder draws discs round the first
point, so that masks are known in closed form. Its inputs have the names, ranks and types of the published exports.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from dlama import FileError, InputError, MaskSession, find_mask
from dlama.models import records
from dlama.perception.masks import segment_anything
from dlama.perception.masks.prompt import Prompt
from dlama.perception.masks.segment_anything import PAIRS, EmbeddedPicture, PairContract, name_candidates
from tiny_networks import saved

RADII = (3.0, 6.0, 9.0)
SCORES = (0.5, 0.9, 0.7)
HW = (40, 80)


def tiny_encoder(path: Path, contract: PairContract, name: str) -> Path:
    """Gives 1 x 1 x 1 x 1: the mean of its input."""
    hwc = contract.layout == "HWC"
    shape = ["h", "w", 3] if hwc else [1, 3, "h", "w"]
    taken = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)]
    given = [helper.make_tensor_value_info("image_embeddings", TensorProto.FLOAT, [1, 1, 1, 1])]
    nodes = [
        helper.make_node("ReduceMean", [name], ["mean"], keepdims=0),
        helper.make_node("Reshape", ["mean", "shape"], ["image_embeddings"]),
    ]
    return saved(path, nodes, (taken, given), {"shape": np.array([1, 1, 1, 1])}, contract.metadata())


def tiny_decoder(path: Path, batched: bool = False, scores: tuple[float, ...] = SCORES) -> Path:
    """Discs of RADII round the first point (given in the pixels of the shown picture, drawn on HW by the share of the sides).

    SAM: point_coords 1 x N x 2, orig_im_size float; EfficientSAM: batched_point_coords 1 x 1 x N x 2, orig_im_size int64.
    """
    height, width = HW
    v, u = np.mgrid[:height, :width] + 0.5
    side = 1 if batched else 1024 / max(HW)
    rank = [1, 1] if batched else [1]
    before = "batched_" if batched else ""
    float_, whole = TensorProto.FLOAT, TensorProto.INT64
    taken = [
        helper.make_tensor_value_info("image_embeddings", float_, [1, 1, 1, 1]),
        helper.make_tensor_value_info(f"{before}point_coords", float_, [*rank, "n", 2]),
        helper.make_tensor_value_info(f"{before}point_labels", float_, [*rank, "n"]),
        helper.make_tensor_value_info("orig_im_size", whole if batched else float_, [2]),
    ]
    if not batched:
        taken += [
            helper.make_tensor_value_info("mask_input", float_, [1, 1, 4, 4]),
            helper.make_tensor_value_info("has_mask_input", float_, [1]),
        ]
    masks, count = "output_masks" if batched else "masks", [1, 1, 3] if batched else [1, 3]
    given = [
        helper.make_tensor_value_info(masks, float_, [*count, height, width]),
        helper.make_tensor_value_info("iou_predictions", float_, [*count[:-1], len(scores)]),
    ]
    constants = {
        "flat": np.array([-1, 2]), "first": np.array([0]), "grid": (side * np.stack([u, v], 2)).astype(np.float32),
        "limits": (side * np.array(RADII, np.float32) ** 2 * side)[:, None, None].astype(np.float32),
        "shape": np.array([*count, height, width]), "scores": np.array(scores, np.float32).reshape([*count[:-1], -1]),
    }  # fmt: skip
    nodes = [
        helper.make_node("Reshape", [f"{before}point_coords", "flat"], ["points"]),
        helper.make_node("Gather", ["points", "first"], ["point"], axis=0),
        helper.make_node("Sub", ["grid", "point"], ["apart"]),
        helper.make_node("ReduceSumSquare", ["apart"], ["d2"], axes=[2], keepdims=0),
        helper.make_node("Sub", ["limits", "d2"], ["discs"]),
        helper.make_node("Reshape", ["discs", "shape"], [masks]),
        helper.make_node("Identity", ["scores"], ["iou_predictions"]),
    ]
    return saved(path, nodes, (taken, given), constants)


def picture() -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (*HW, 3)).astype(np.uint8)


def disc(x: float, y: float, radius: float) -> np.ndarray:
    v, u = np.mgrid[: HW[0], : HW[1]] + 0.5
    return (u - x) ** 2 + (v - y) ** 2 < radius**2


INPUTS = {"sam-vit-b": "x", "mobile-sam": "input_image", "efficient-sam": "batched_images"}


@pytest.mark.parametrize("name", PAIRS)
def test_a_click_becomes_the_decoders_mask(tmp_path: Path, name: str) -> None:
    """Oracle: the discs. The mask with the best score is the object, its smaller neighbour the part, its larger the group."""
    encoder = tiny_encoder(tmp_path / "encoder.onnx", PAIRS[name], INPUTS[name])
    decoder = tiny_decoder(tmp_path / "decoder.onnx", batched=name == "efficient-sam")
    for model in ((encoder, decoder), f"{name}={encoder},{decoder}", f"{encoder},{decoder}"):
        found = find_mask(picture(), clicks=[(30, 20)], masker="segment-anything", mask_model=model)
        assert (found.masker, found.chosen) == ("segment-anything", "object")
        for candidate, radius in zip(("part", "object", "group"), RADII):
            np.testing.assert_array_equal(found.candidates[candidate], disc(30, 20, radius))
    part = find_mask(picture(), clicks=[(30, 20)], masker="segment-anything", mask_model=model, candidate="part")
    np.testing.assert_array_equal(part.mask, disc(30, 20, RADII[0]))


def test_the_encoder_runs_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second click is answered from the embedding (oracle: a count of the encoder's runs)."""
    encoder = tiny_encoder(tmp_path / "encoder.onnx", PAIRS["sam-vit-b"], "x")
    session = MaskSession(
        picture(), masker="segment-anything", mask_model=(encoder, tiny_decoder(tmp_path / "decoder.onnx"))
    )
    runs = []
    original = segment_anything.NetworkFile.run
    monkeypatch.setattr(segment_anything.NetworkFile, "run", lambda self, feed: runs.append(1) or original(self, feed))
    for x in (20, 30, 50):
        np.testing.assert_array_equal(session.find(clicks=[(x, 20)]).mask, disc(x, 20, RADII[1]))
    assert len(runs) == 1


def seen(contract: PairContract) -> EmbeddedPicture:
    return EmbeddedPicture(None, contract, np.zeros(1), HW)  # type: ignore[arg-type]


def test_points_are_given_as_the_decoder_wants_them() -> None:
    """Closed form: SAM counts in pixels of the longer side 1024, with a padding point where there is no box; labels 1 on,
    0 next to, 2 and 3 corners. EfficientSAM counts in pixels of the picture, without padding."""
    prompt = Prompt(HW, ((10, 20),), ((40, 4),))
    points, labels = seen(PAIRS["sam-vit-b"]).points(prompt)
    np.testing.assert_allclose(points, [[128, 256], [512, 51.2], [0, 0]], rtol=1e-6)
    assert labels.tolist() == [1, 0, -1]
    points, labels = seen(PAIRS["efficient-sam"]).points(Prompt(HW, box=(10, 20, 30, 8)))
    assert points.tolist() == [[10, 20], [40, 28]] and labels.tolist() == [2, 3]


def test_pictures_are_shown_as_the_encoders_want_them() -> None:
    """SAM: normalised, zeros below up to 1024 x 1024; MobileSAM: rows first, 0..255, no padding; EfficientSAM: as it is, 0..1."""
    color = np.full((*HW, 3), 51, np.uint8)
    sam = PAIRS["sam-vit-b"].tensor(color)
    assert sam.shape == (1, 3, 1024, 1024) and not sam[..., 512:, :].any()
    np.testing.assert_allclose(
        sam[0, :, 5, 1000], (0.2 - np.array([0.485, 0.456, 0.406])) / [0.229, 0.224, 0.225], rtol=1e-5
    )
    assert PAIRS["mobile-sam"].tensor(color).shape == (512, 1024, 3) and PAIRS["mobile-sam"].tensor(color).max() == 51
    shown = PAIRS["efficient-sam"].tensor(color)
    assert shown.shape == (1, 3, *HW) and shown.max() == pytest.approx(0.2)


def test_of_four_masks_the_first_is_for_several_points() -> None:
    """As the authors' own choice of a mask does it: one click takes the best of the last three, a box or two clicks the first."""
    masks = np.stack([np.where(disc(30, 20, radius), 1.0, -1.0) for radius in (5, 3, 6, 9)]).astype(np.float32)
    scores = np.float32([0.99, 0.5, 0.9, 0.7])
    one, _ = name_candidates(masks, scores, Prompt(HW, ((30, 20),)))
    two, _ = name_candidates(masks, scores, Prompt(HW, ((30, 20),), ((1, 1),)))
    np.testing.assert_array_equal(one["object"], disc(30, 20, 6))
    np.testing.assert_array_equal(two["object"], disc(30, 20, 5))


def test_what_cannot_run_is_one_line(tmp_path: Path) -> None:
    """No model, an unknown name, files without a contract, a decoder with other inputs, another network's contract."""
    encoder = tiny_encoder(tmp_path / "encoder.onnx", PAIRS["sam-vit-b"], "x")
    decoder = tiny_decoder(tmp_path / "decoder.onnx")

    def refused(model: object, kind: type[Exception], words: str) -> None:
        with pytest.raises(kind, match=words):
            find_mask(picture(), clicks=[(3, 4)], masker="segment-anything", mask_model=model)  # type: ignore[arg-type]

    refused(None, InputError, "mask_model names none; one of sam-vit-b, mobile-sam, efficient-sam")
    refused("sam-vit-x", InputError, "mask_model is 'sam-vit-x'; one of sam-vit-b")
    refused((decoder, decoder), InputError, "carries no contract")
    refused((encoder, tmp_path / "none.onnx"), FileError, "no such model file")
    few = tiny_decoder(tmp_path / "few.onnx", scores=SCORES[:2])
    refused(
        (encoder, few),
        FileError,
        "few.onnx: gave masks 1 x 3 x 40 x 80, iou_predictions 1 x 2; .* as many iou_predictions",
    )
    refused((encoder, encoder), FileError, "takes an input 'x', which no known decoder has")
    refused(f"mobile-sam={encoder},{decoder}", FileError, "one float picture, HWC, is expected")
    model = onnx.load(str(encoder))
    helper.set_model_props(model, {"dlama.contract": json.dumps({"network": "monocular depth"})})
    onnx.save(model, str(tmp_path / "other.onnx"))
    refused((tmp_path / "other.onnx", decoder), FileError, "is a network 'monocular depth' by its contract")
    with pytest.raises(InputError, match="'salient' runs no network of the user's choice"):
        find_mask(picture(), masker="salient", mask_model="mobile-sam")


@pytest.mark.parametrize("name", PAIRS)
def test_every_pair_is_in_the_catalogue(name: str) -> None:
    """Both files, as networks of masks."""
    for part in ("encoder", "decoder"):
        assert records.CATALOGUE[f"{name}-{part}"].contract == "mask-network"
