"""Gaussian splats in; a compressed SPZ file out (Niantic's, version 3, https://github.com/nianticlabs/spz): a fifth of the bytes
of a PLY file or less, without view-dependent colour. Axes are OpenGL's, as there."""

from __future__ import annotations

import gzip
import math
import struct

import numpy as np

from dlama.files.scenes.glb import GLTF_FROM_OPENCV
from dlama.files.scenes.splats import FIELDS, warn_of_rounding
from dlama.writing.atomic_write import PathLike, write_file


def write_spz(path: PathLike, rows: np.ndarray) -> None:
    """Write splats (N x len(FIELDS), of `scene_splats`): positions to 24 bits, of rotations three numbers to 10, the rest to 8.

    Positions are exact to .03 mm up to 512 m from the origin; the error doubles with each doubling of the farthest coordinate.
    Warns of a far origin. OutputError.
    """
    column = {name: number for number, name in enumerate(FIELDS)}

    def take(*names: str) -> np.ndarray:
        return rows[:, [column[name] for name in names]]

    points = take(*"xyz") * GLTF_FROM_OPENCV
    # 14 fractional bits at most, .06 mm: two more than Niantic's writer has, for small objects, cost 1 % of the bytes
    bits = max(0, min(14, 22 - math.floor(math.log2(max(1.0, float(np.abs(points).max(initial=0)))))))
    fixed = np.clip(np.rint(points * 2**bits), 1 - 2**23, 2**23 - 1).astype("<i4", order="C")
    warn_of_rounding(path, rows, fixed / 2**bits * GLTF_FROM_OPENCV)
    opacity = 255 / (1 + np.exp(-take("opacity")))
    color = take("f_dc_0", "f_dc_1", "f_dc_2") * (0.15 * 255) + 127.5  # so that colours beyond 0..1 can be stored
    scales = (take("scale_0", "scale_1", "scale_2") + 10) * 16
    turned = take("rot_1", "rot_2", "rot_3", "rot_0") * (*GLTF_FROM_OPENCV, 1)
    header = struct.pack("<4sIIBBBB", b"NGSP", 3, len(rows), 0, bits, 0, 0)
    three_bytes = fixed.view(np.uint8).reshape(-1, 4)[:, :3]
    parts = (three_bytes, levels(opacity), levels(color), levels(scales), pack(turned))
    body = b"".join(part.tobytes() for part in parts)
    write_file(path, gzip.compress(header + body, mtime=0))


def levels(values: np.ndarray) -> np.ndarray:
    """The nearest whole numbers of 0..255."""
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def pack(quaternions: np.ndarray) -> np.ndarray:
    """N little-endian uint32 of N x 4 unit quaternions (x, y, z, w): where the largest is (2 bits), the others (sign, 9 bits)."""
    largest = np.argmax(np.abs(quaternions), axis=1)
    row = np.arange(len(quaternions))
    upright = quaternions * np.where(quaternions[row, largest] < 0, -1, 1)[:, None]
    others = upright[np.arange(4) != largest[:, None]].reshape(-1, 3)
    size = np.minimum(511, np.rint(511 * math.sqrt(2) * np.abs(others))).astype(np.uint32)
    parts = size | ((others < 0).astype(np.uint32) << 9)
    return (largest.astype(np.uint32) << 30 | parts[:, 0] << 20 | parts[:, 1] << 10 | parts[:, 2]).astype("<u4")
