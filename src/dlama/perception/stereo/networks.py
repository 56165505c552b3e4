"""An ONNX network of stereo matching (such as RAFT-Stereo) in; a matcher, both pictures to both disparities, out.

How a network expects its pictures and what its numbers mean is data, a StereoContract: in the file's metadata under
`dlama.contract`, or in FILE.json next to FILE.onnx.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from dlama.errors import FileError, InputError
from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.models.cache import user_path
from dlama.models.contracts import ColorContract
from dlama.models.network_file import NetworkFile, open_kept
from dlama.perception.stereo.consistency import keep_consistent, zero_where_unknown


@dataclass(frozen=True)
class StereoContract(ColorContract):
    """What a network of stereo matching takes (the left, then the right picture, 1 x 3 x H x W) and gives. InputError for
    contradictions."""

    network = "stereo matching"
    scale: float = 1.0
    """RAFT-Stereo takes colours as they are."""
    multiple: int = 32
    """Pictures are continued at their right and lower borders to a multiple of this height and width."""
    size: tuple[int, int] | None = None
    """The only height and width it takes, to which pictures are stretched; None: any that `multiple` allows."""
    sign: int = 1
    """1: it gives left x minus right x; -1: the flow from left to right, as RAFT-Stereo does."""
    output_scale: float = 1.0
    """Pixels, of the pictures as shown, in one unit of what it gives."""
    output: str | None = None
    """Name of the output that is used; None: the last, which is the full-size one of RAFT-Stereo."""

    def __post_init__(self) -> None:
        self.check_colors()
        if min(self.size or (self.multiple,)) < 1:
            raise InputError("contract: size and multiple of 1 or more are expected")
        if self.sign not in (1, -1) or not self.output_scale > 0:
            raise InputError(
                f"contract: sign is {self.sign} and output_scale {self.output_scale}; 1 or -1, and above 0 are expected"
            )

    def tensor(self, color: UInt8Array) -> Float32Array:
        """A picture (H x W x 3, RGB) as the network takes it, 1 x 3 x H' x W'."""
        if self.size is not None:
            shown = cv2.resize(color, self.size[::-1], interpolation=cv2.INTER_AREA)
        else:
            below, sidecar = (-side % self.multiple for side in color.shape[:2])
            shown = cv2.copyMakeBorder(color, 0, below, 0, sidecar, cv2.BORDER_REPLICATE)
        return np.ascontiguousarray(self.normalize(shown).transpose(2, 0, 1))[None]

    def disparity(self, out: Float32Array, hw: tuple[int, int]) -> Float32Array:
        """Pixels of a picture of that size from what the network gave (h x w)."""
        pixels = out * np.float32(self.sign * self.output_scale)
        if self.size is None:
            return np.ascontiguousarray(pixels[: hw[0], : hw[1]])
        stretched = cv2.resize(pixels, hw[::-1], interpolation=cv2.INTER_LINEAR)
        return np.asarray(stretched * np.float32(hw[1] / out.shape[1]), np.float32)


@dataclass(frozen=True, eq=False)
class NetworkMatcher:
    """A network ready to match pairs; a Matcher of `dlama.perception.stereo.matching`."""

    file: NetworkFile
    contract: StereoContract

    @classmethod
    def open(cls, path: str | Path) -> NetworkMatcher:
        """The matcher of a network file, by the contract in its metadata or in the JSON file next to it. FileError: no such file,
        no contract, or one that cannot be read."""
        file = open_kept(NetworkFile, user_path(path))
        contract, sidecar = StereoContract.of_file(file), file.path.with_suffix(".json")
        if contract is None and not sidecar.is_file():
            raise FileError(
                f"{file.path}: carries no contract; {sidecar.name} next to it is expected, such as "
                '{"network": "stereo matching", "scale": 1, "multiple": 32, "sign": -1} for RAFT-Stereo'
            )
        return cls(file, contract or StereoContract.read(sidecar.read_text(encoding="utf-8"), file.path))

    def __call__(self, left: UInt8Array, right: UInt8Array) -> tuple[Float32Array, Float32Array]:
        """The disparity of each picture (H x W px, 0 = unknown), matched both ways and checked for consistency. FileError where
        the file does not keep its contract."""
        at_left = self.match(left, right)
        # mirrored left and right, the right view is a left one
        at_right = np.ascontiguousarray(self.match(right[:, ::-1], left[:, ::-1])[:, ::-1])
        at_left, at_right = keep_consistent(at_left, at_right)
        return zero_where_unknown(at_left), zero_where_unknown(at_right)

    def match(self, base: UInt8Array, other: UInt8Array) -> Float32Array:
        """H x W px of `base` against `other`, as the network says."""
        names = list(self.file.inputs)
        if len(names) != 2:
            raise FileError(
                f"{self.file.path}: takes {len(names)} inputs ({', '.join(names)}); left and right are expected"
            )
        feed = {name: self.contract.tensor(np.ascontiguousarray(one)) for name, one in zip(names, (base, other))}
        outputs = dict(zip(self.file.outputs, self.file.run_all(feed)))
        expected = self.contract.output or list(outputs)[-1]
        if expected not in outputs:
            raise FileError(f"{self.file.path}: gives {', '.join(outputs)}; its contract wants {expected}")
        shown = next(iter(feed.values())).shape[2:]
        out = np.asarray(outputs[expected], np.float32)
        if out.ndim not in (2, 3, 4) or out.shape[-2:] != shown or not np.isfinite(out).all():
            raise FileError(
                f"{self.file.path}: gave {' x '.join(map(str, out.shape))}; "
                f"finite numbers of {shown[0]} x {shown[1]} are expected"
            )
        return self.contract.disparity(out.reshape(-1, *shown)[0], base.shape[:2])
