"""A picture and clicks or a box in; masks by a network of the Segment Anything family out. No depth is needed.

An encoder embeds the picture once; a decoder answers each prompt from the embedding. How an encoder expects the picture is
data, a PairContract. What a decoder takes follows from the names of its inputs, which all published exports share.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from dlama.errors import FileError, InputError, MaskError
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.models.cache import locate, user_path
from dlama.models.contracts import ColorContract
from dlama.models.network_file import NetworkFile, make_room, open_kept
from dlama.perception.depth_networks import IMAGENET
from dlama.perception.masks.photo import name_masks
from dlama.perception.masks.prompt import Pointed, Prompt

POINTS = ("point_coords", "batched_point_coords")
LABELS = ("point_labels", "batched_point_labels")
DTYPES = {"tensor(float)": np.float32, "tensor(int64)": np.int64, "tensor(int32)": np.int32}
"""Of a decoder's inputs."""


@dataclass(frozen=True)
class PairContract(ColorContract):
    """How the encoder of a pair expects its picture. InputError for contradictions."""

    network = "mask encoder"
    side: int | None = 1024
    """Pixels of the longer side at which the picture is shown, and in which points are given; None: as it is."""
    padded: bool = True
    """Whether zeros follow to the right and below, up to side x side."""
    layout: Literal["BCHW", "HWC"] = "BCHW"
    """Order of the input's axes; colours are RGB."""

    def __post_init__(self) -> None:
        if self.layout not in ("BCHW", "HWC"):
            raise InputError(f"contract: layout is {self.layout!r}; BCHW or HWC is expected")
        self.check_colors()
        if (self.side is None and self.padded) or (self.side is not None and self.side < 1):
            raise InputError("contract: side of 1 or more, or none and no padding, are expected")

    def shown_hw(self, hw: tuple[int, int]) -> tuple[int, int]:
        """Height and width at which a picture of that size is shown."""
        if self.side is None:
            return hw
        factor = self.side / max(hw)
        return max(1, int(hw[0] * factor + 0.5)), max(1, int(hw[1] * factor + 0.5))

    def tensor(self, color: UInt8Array) -> Float32Array:
        """The picture (H x W x 3, RGB) as the encoder takes it."""
        height, width = self.shown_hw(color.shape[:2])
        how = cv2.INTER_AREA if height * width < color.shape[0] * color.shape[1] else cv2.INTER_LINEAR
        shown = self.normalize(cv2.resize(color, (width, height), interpolation=how))
        if self.padded and self.side is not None:
            shown = np.pad(shown, ((0, self.side - height), (0, self.side - width), (0, 0)))
        return np.ascontiguousarray(shown if self.layout == "HWC" else shown.transpose(2, 0, 1)[None])


@dataclass(frozen=True, eq=False)
class EmbeddedPicture:
    """The embedding of a picture, and the decoder that answers prompts from it."""

    decoder: NetworkFile
    contract: PairContract
    embedding: np.ndarray
    hw: tuple[int, int]
    """Of the picture."""

    def decode(self, prompt: Prompt) -> tuple[Float32Array, Float32Array]:
        """Masks at the decoder's size, M x H x W, above 0 on the object, and M scores. FileError: an unknown decoder."""
        named = dict(zip(self.decoder.outputs, self.decoder.run_all(self.feed(prompt))))
        masks = next((named[name] for name in ("masks", "output_masks") if name in named), None)
        scores = named.get("iou_predictions")
        if masks is not None and scores is not None and masks.shape[-2:] == self.hw and masks.ndim in (4, 5):
            flat = masks.reshape(-1, *self.hw).astype(np.float32), np.asarray(scores, np.float32).ravel()
            if 0 < len(flat[0]) == len(flat[1]):
                return flat
        found = ", ".join(f"{name} {' x '.join(map(str, value.shape))}" for name, value in named.items())
        height, width = self.hw
        raise FileError(
            f"{self.decoder.path}: gave {found}; masks (or output_masks) of {height} x {width} "
            "and as many iou_predictions are expected"
        )

    def feed(self, prompt: Prompt) -> dict[str, np.ndarray]:
        """The decoder's inputs by name; FileError where it takes others."""
        points, labels = self.points(prompt)
        known: dict[str, np.ndarray] = dict.fromkeys(POINTS, points) | dict.fromkeys(LABELS, labels)
        known |= {"image_embeddings": self.embedding, "orig_im_size": np.array(self.hw), "has_mask_input": np.zeros(1)}
        feed: dict[str, np.ndarray] = {}
        for name, (kind, shape) in self.decoder.inputs.items():
            value = known.get(name)
            if name == "mask_input":
                value = np.zeros([side if isinstance(side, int) else 1 for side in shape])
            if value is None:
                raise FileError(f"{self.decoder.path}: takes an input {name!r}, which no known decoder has")
            if name in POINTS + LABELS:
                value = value.reshape((1,) * (len(shape) - value.ndim) + value.shape)
            feed[name] = np.ascontiguousarray(value, DTYPES.get(kind, np.float32))
        if not {*POINTS} & {*feed} or not {*LABELS} & {*feed} or "image_embeddings" not in feed:
            raise FileError(
                f"{self.decoder.path}: takes {', '.join(feed)}; image_embeddings, point_coords and point_labels are expected"
            )
        return feed

    def points(self, prompt: Prompt) -> tuple[Float32Array, Float32Array]:
        """N x 2 points (x, y) in the pixels in which the encoder saw the picture, and their N labels: 1 on the object, 0 on the
        background, 2 and 3 the corners of a box, -1 no point."""
        points = [(x, y, 1) for x, y in prompt.clicks] + [(x, y, 0) for x, y in prompt.not_clicks]
        if prompt.box is not None:
            x, y, wide, high = prompt.box
            points += [(x, y, 2), (x + wide, y + high, 3)]
        elif self.contract.side is not None:
            points.append((0, 0, -1))
        shown = self.contract.shown_hw(self.hw)
        table = np.array(points, np.float32)
        return table[:, :2] * np.array([shown[1] / self.hw[1], shown[0] / self.hw[0]], np.float32), table[:, 2]


def segment_anything_masker(color: UInt8Array, mask_model: object) -> Pointed:
    """The masker of one picture (H x W x 3): it is encoded once. InputError: no such pair; FileError: files that keep no
    contract."""
    make_room(color[..., 0].size)
    encoder, decoder, contract = find_pair(mask_model)
    tensor = contract.tensor(color)
    inputs = list(encoder.inputs.items())
    if len(inputs) != 1 or len(inputs[0][1][1]) != tensor.ndim or inputs[0][1][0] != "tensor(float)":
        raise FileError(f"{encoder.path}: takes {encoder.inputs}; one float picture, {contract.layout}, is expected")
    embedding = encoder.run({inputs[0][0]: tensor})
    seen = EmbeddedPicture(decoder, contract, embedding, (color.shape[0], color.shape[1]))
    return lambda prompt: name_candidates(*seen.decode(prompt), prompt)


def name_candidates(
    masks: Float32Array, scores: Float32Array, prompt: Prompt
) -> tuple[dict[str, BoolArray], tuple[str, ...]]:
    """The mask with the best score as `object`, the next smaller one as `part`, the next larger one as `group`; and notes.

    Raises MaskError where the best mask is empty.
    """
    found = [(mask > 0) for mask in masks]
    best = int(np.argmax(scores))
    if len(found) == 4:  # the first mask is learnt for several points, the others for one (Kirillov et al. 2023)
        count = len(prompt.clicks) + len(prompt.not_clicks) + 2 * (prompt.box is not None)
        best = 0 if count > 1 else 1 + int(np.argmax(scores[1:]))
    if not found[best].any():
        raise MaskError("the network sees nothing there; other clicks, or a box round the object, are expected")
    size = int(found[best].sum())
    others = sorted((mask for mask in found if mask.any()), key=lambda mask: abs(int(mask.sum()) - size))
    return name_masks(found[best], others, 0.95), (f"score {scores[best]:.2f}",)


def find_pair(mask_model: object) -> tuple[NetworkFile, NetworkFile, PairContract]:
    """Encoder, decoder and contract of a name of PAIRS, of `NAME=ENCODER,DECODER`, or of two files (or `ENCODER,DECODER`), the
    first with its contract. InputError, FileError."""
    expected = (
        f"one of {', '.join(PAIRS)} (pulled before), ENCODER.onnx,DECODER.onnx, or NAME=ENCODER.onnx,DECODER.onnx"
    )
    if mask_model is None:
        raise InputError(
            f"masker 'segment-anything' runs a pair of networks and `mask_model` names none; {expected} is expected"
        )
    files, contract = _files_of(mask_model)
    if len(files) != 2:
        raise InputError(f"`mask_model` is {mask_model!r}; {expected} is expected")
    encoder, decoder = (open_kept(NetworkFile, user_path(file)) for file in files)
    contract = contract or PairContract.of_file(encoder)
    if contract is None:
        raise InputError(
            f"{encoder.path}: carries no contract; say whose it keeps: `mask_model=NAME={files[0].name},{files[1].name}`, "
            f"NAME of {', '.join(PAIRS)}"
        )
    return encoder, decoder, contract


def _files_of(mask_model: object) -> tuple[list[Path], PairContract | None]:
    """The files that a mask_model names, and the contract where it names one of PAIRS."""
    if isinstance(mask_model, tuple):
        return [Path(one) for one in mask_model], None
    text = str(mask_model)
    if text in PAIRS:
        return [locate(f"{text}-encoder"), locate(f"{text}-decoder")], PAIRS[text]
    name, equals, after = text.partition("=")
    contract = PAIRS[name] if equals and name in PAIRS else None
    return [Path(one) for one in (after if contract else text).split(",")], contract


PAIRS: dict[str, PairContract] = {
    "sam-vit-b": PairContract(mean=IMAGENET[0], std=IMAGENET[1]),
    "mobile-sam": PairContract(padded=False, layout="HWC", scale=1.0),
    "efficient-sam": PairContract(side=None, padded=False),
}
"""Name -> contract; the files are the catalogue's models NAME-encoder and NAME-decoder."""
