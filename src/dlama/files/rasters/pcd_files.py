"""A point cloud of PCL with a point for each pixel of a picture (organised PCD) in; H x W of its z, as stored, out."""

from __future__ import annotations

import io
import math
import re

import numpy as np

from dlama.errors import FileError, any_error
from dlama.files.rasters.images import check_pixels, existing_file
from dlama.writing.atomic_write import PathLike

HEADER = re.compile(rb"(?:#[^\n]*\n)*VERSION[^\n]*\n((?:[A-Z]+ [^\n]*\n)+?)DATA (ascii|binary|binary_compressed)\r?\n")


def read_pcd(path: PathLike) -> np.ndarray:
    """H x W of the field z of an organised PCD: text, binary or compressed. NaN is missing. Raises FileError."""
    file = existing_file(path)
    data = file.read_bytes()
    found = HEADER.match(data[:4096])
    if found is None:
        raise FileError(f"{file}: is no PCD point cloud (a header VERSION, FIELDS, ..., DATA is expected)")
    with any_error(FileError, f"{file}: is damaged, truncated or no PCD point cloud"):
        head = {name: words for name, *words in map(str.split, found[1].decode("ascii").splitlines())}
        width, height = int(head["WIDTH"][0]), int(head["HEIGHT"][0])
        if height < 2:
            raise FileError(
                f"{file}: is a cloud of {width} points in no order; one with a point for each pixel is expected"
            )
        check_pixels(file, width, height)
        place, counts = head["FIELDS"].index("z"), list(map(int, head.get("COUNT", ["1"] * len(head["FIELDS"]))))
        before = [int(size) * count for size, count in zip(head["SIZE"], counts)]
        kind = np.dtype(f"<{head['TYPE'][place].lower()}{head['SIZE'][place]}")
        body, number, first = data[found.end() :], width * height, sum(before[:place])
        if found[2] == b"ascii":
            column = sum(counts[:place])
            return np.loadtxt(io.BytesIO(body), kind, usecols=column, max_rows=number, ndmin=1).reshape(height, width)
        if found[2] == b"binary":
            points = np.frombuffer(body, np.uint8, number * sum(before)).reshape(number, -1)
            return points[:, first : first + kind.itemsize].copy().view(kind).reshape(height, width)
        packed, size = map(int, np.frombuffer(body, "<u4", 2))
        if size != number * sum(before):
            raise ValueError(f"it says {size} bytes, {number * sum(before)} are expected")
        fields = decompress(body[8 : 8 + packed], size)
        return np.frombuffer(fields, kind, number, number * first).reshape(height, width)


def decompress(data: bytes, size: int) -> bytes:
    """What LibLZF compressed to `data`: `size` bytes. ValueError, IndexError: it is no such data."""
    found, at = bytearray(), 0
    while at < len(data) and len(found) < size:
        control, at = data[at], at + 1
        if control < 32:
            found += data[at : at + control + 1]
            at += control + 1
            continue
        length = control >> 5
        if length == 7:
            length, at = length + data[at], at + 1
        start = len(found) - ((control & 31) << 8) - data[at] - 1
        if start < 0:
            raise ValueError("it points before its beginning")
        piece = found[start : start + length + 2]
        found += (piece * math.ceil((length + 2) / len(piece)))[: length + 2]
        at += 1
    if len(found) != size:
        raise ValueError(f"{len(found)} bytes are in it, {size} are expected")
    return bytes(found)
