"""A model's name in; what is known of it out: addresses, sha256, licence, and which contract its file follows.

No file was examined: addresses and hashes are as others publish them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from dlama.errors import InputError

Contract: TypeAlias = Literal["lama-weights", "depth-network", "mask-network"]


@dataclass(frozen=True)
class Record:
    """One file that can be pulled."""

    name: str
    """Name for users."""
    what: str
    """One line: what it does."""
    urls: tuple[str, ...]
    """Mirrors, tried in this order; all of them hold the same bytes."""
    sha256: str | None
    """64 hexadecimal digits of what the addresses serve; None: unknown, pinned on first use."""
    bytes: int | None
    """Size of what the addresses serve; None: unknown."""
    licence: str
    """Of the weights: an SPDX name."""
    contract: Contract
    """How the file is to be used: lama-weights are converted to ONNX first; a depth-network and a mask-network run as
    they are (what they take and give stands in `dlama.perception.monocular.ESTIMATORS` and
    `dlama.perception.masks.segment_anything.PAIRS`)."""
    file: str
    """Its name in the cache directory."""
    note: str = ""
    """Notes for users."""


_DEPTH_ANYTHING_ONNX = "https://github.com/fabio-sim/Depth-Anything-ONNX/releases/download/v2.0.0"
_MOBILE_SAM = "https://huggingface.co/Acly/MobileSAM/resolve/0d3b403339b4674a82493d5e97964dd78089ddc8"
_SAM = "https://github.com/wkentaro/labelme/releases/download/sam-20230416"
_EFFICIENT_SAM = "https://github.com/labelmeai/efficient-sam/releases/download/onnx-models-20231225"


def _segment_anything(name: str, what: str, url: str, sha256: str, size: int) -> Record:
    """The encoder or decoder of a network of the Segment Anything family, in ONNX."""
    return Record(name, what, (url,), sha256, size, "Apache-2.0", "mask-network", f"{name}.onnx")


CATALOGUE: dict[str, Record] = {
    record.name: record
    for record in (
        Record(
            name="big-lama",
            what="LaMa with 18 blocks, trained on Places: fills holes of any size in colour (TorchScript)",
            urls=(
                "https://github.com/Sanster/models/releases/download/add_big_lama/big-lama.pt",
                "https://huggingface.co/signature-ai/big-lama/resolve/main/big-lama.pt",
            ),
            sha256="344c77bbcb158f17dd143070d1e789f38a66c04202311ae3a258ef66667a9ea9",
            bytes=205669692,
            licence="Apache-2.0",
            contract="lama-weights",
            file="big-lama.pt",
        ),
        Record(
            name="depth-anything-small",
            what="Depth Anything V2 small: relative inverse depth of a single picture",
            urls=("https://huggingface.co/onnx-community/depth-anything-v2-small/resolve/main/onnx/model.onnx",),
            sha256="afb6a5c28f3b6bf1618c6e43f02073ef9dfdc70e937502d51603e57b0a1df10c",
            bytes=99060839,
            licence="Apache-2.0",
            contract="depth-network",
            file="depth-anything-small.onnx",
            note="Its larger siblings are CC-BY-NC-4.0.",
        ),
        Record(
            name="depth-anything-indoor",
            what="Depth Anything V2 small, trained on Hypersim: depth of a single indoor picture in metres, up to 20",
            urls=(f"{_DEPTH_ANYTHING_ONNX}/depth_anything_v2_vits_indoor_dynamic.onnx",),
            sha256="2e25a3f332b34d885a1b3059cab471f7916a36099325810821b2d6e0471f74ad",
            bytes=None,
            licence="Apache-2.0",
            contract="depth-network",
            file="depth-anything-indoor.onnx",
            note="About 95 MB.",
        ),
        Record(
            name="depth-anything-outdoor",
            what="Depth Anything V2 small, trained on Virtual KITTI 2: depth of a single outdoor picture in metres, up to 80",
            urls=(f"{_DEPTH_ANYTHING_ONNX}/depth_anything_v2_vits_outdoor_dynamic.onnx",),
            sha256=None,
            bytes=None,
            licence="Apache-2.0",
            contract="depth-network",
            file="depth-anything-outdoor.onnx",
            note="About 95 MB.",
        ),
        Record(
            name="moge-small",
            what="MoGe-2 (ViT-S, with normals): a point map of a single picture in metres, and its field of view",
            urls=("https://huggingface.co/Ruicheng/moge-2-vits-normal-onnx/resolve/main/model.onnx",),
            sha256="24eacb5dc7a2c54c7bc98f7de085ffbed79ad006ea5b664c2c2cdc02ff3a52f0",
            bytes=140852051,
            licence="MIT",
            contract="depth-network",
            file="moge-small.onnx",
            note="Parts of DINOv2 in it are Apache-2.0.",
        ),
        _segment_anything(
            "sam-vit-b-encoder",
            "Segment Anything ViT-B, 8-bit weights: the encoder, for --masker segment-anything",
            f"{_SAM}/sam_vit_b_01ec64.quantized.encoder.onnx",
            "3346b9cc551c9902fbf3b203935e933592b22e042365f58321c17fc12641fd6a",
            99827688,
        ),
        _segment_anything(
            "sam-vit-b-decoder",
            "Segment Anything ViT-B, 8-bit weights: the decoder",
            f"{_SAM}/sam_vit_b_01ec64.quantized.decoder.onnx",
            "edbcf1a0afaa55621fb0abe6b3db1516818b609ea9368f309746a3afc68f7613",
            8743656,
        ),
        _segment_anything(
            "mobile-sam-encoder",
            "MobileSAM (TinyViT): the encoder, for --masker segment-anything",
            f"{_MOBILE_SAM}/mobile_sam_image_encoder.onnx",
            "580f5fb648ea1062c0aabc26217aed56921985f03f0cbbd852bba81d760cc749",
            28157093,
        ),
        _segment_anything(
            "mobile-sam-decoder",
            "MobileSAM: the decoder, four masks",
            f"{_MOBILE_SAM}/sam_mask_decoder_multi.onnx",
            "8976b90a87ba50a6a72217a5ff994f7d25ce16f2229fcc1ed259e1294c622ffe",
            16496559,
        ),
        _segment_anything(
            "efficient-sam-encoder",
            "EfficientSAM-Ti: the encoder, for --masker segment-anything",
            f"{_EFFICIENT_SAM}/efficient_sam_vitt_encoder.onnx",
            "7a73ee65aa2c37237c89b4b18e73082f757ffb173899609c5d97a2bbd4ebb02d",
            24799761,
        ),
        _segment_anything(
            "efficient-sam-decoder",
            "EfficientSAM-Ti: the decoder",
            f"{_EFFICIENT_SAM}/efficient_sam_vitt_decoder.onnx",
            "e1afe46232c3bfa3470a6a81c7d3181836a94ea89528aff4e0f2d2c611989efd",
            16565728,
        ),
    )
}
"""Every model that can be named."""


def record(name: str) -> Record:
    """The record of that name; InputError lists the known names."""
    if name not in CATALOGUE:
        raise InputError(f"no model is called {name!r}; known: {', '.join(CATALOGUE)}")
    return CATALOGUE[name]
