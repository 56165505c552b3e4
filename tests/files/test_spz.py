"""Compressed splats (oracle: a reader written from the format's specification, https://github.com/nianticlabs/spz, README)."""

from __future__ import annotations

import gzip
import re
import struct
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dlama.files.scenes.splats import FIELDS, write_splats
from dlama.files.scenes.spz import write_spz


def read_spz(path: Path) -> SimpleNamespace:
    """What a file holds, in its own axes, number by number, as the specification has them."""
    data = np.frombuffer(gzip.decompress(path.read_bytes()), np.uint8)
    magic, version, count, degree, bits, flags, reserved = struct.unpack_from("<IIIBBBB", data)
    assert (magic, version, degree, flags, reserved) == (0x5053474E, 3, 0, 0, 0)
    assert len(data) == 16 + 20 * count
    widths = (9, 1, 3, 3, 4)
    parts = np.split(data[16:], count * np.cumsum(widths[:-1]))
    points, alphas, color, scales, turns = (part.reshape(count, width) for part, width in zip(parts, widths))
    fixed = [int.from_bytes(bytes(each), "little", signed=True) for each in points.reshape(-1, 3)]
    return SimpleNamespace(
        bits=bits,
        points=np.reshape(fixed, (count, 3)) / 2**bits,
        opacity=alphas[:, 0] / 255,
        color=(color / 255 - 0.5) / 0.15,
        sizes=scales / 16 - 10,
        turns=np.array([smallest_three(int.from_bytes(bytes(each), "little")) for each in turns]),
    )


def smallest_three(word: int) -> list[float]:
    """x, y, z, w: the largest is not stored; the last of the others lies in the lowest bits."""
    largest, found = word >> 30, [0.0] * 4
    for place in (3, 2, 1, 0):
        if place != largest:
            found[place] = (word & 511) / 511 * 0.5**0.5 * (-1 if word & 512 else 1)
            word >>= 10
    found[largest] = (1 - sum(value**2 for value in found)) ** 0.5
    return found


def splats(count: int, reach: float) -> np.ndarray:
    """Random ones; the first rotations are about the axes, and halfway between them."""
    rng = np.random.default_rng(1)
    turns = np.concatenate([np.eye(4), -np.eye(4), [(0.5, 0.5, -0.5, 0.5)], rng.normal(size=(count, 4))])[:count]
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    parts = {
        "xyz": rng.uniform(-reach, reach, (count, 3)),
        "normal": np.zeros((count, 3)),
        "color": rng.uniform(-1.77, 1.77, (count, 3)),
        "opacity": rng.normal(0, 3, (count, 1)),
        "scales": rng.uniform(-9, 5, (count, 3)),
        "turns": turns,
    }
    return np.concatenate(list(parts.values()), 1)


@pytest.mark.filterwarnings("ignore:a.spz. splats are moved")
@pytest.mark.parametrize("reach, bits", [(0.3, 14), (500, 14), (1500, 12), (1e5, 6)])
def test_what_is_read_is_what_was_written(tmp_path: Path, reach: float, bits: int) -> None:
    """Within half a step of each number; y and z change their signs, as OpenGL's axes do."""
    rows = splats(200, reach)
    write_spz(tmp_path / "a.spz", rows)
    found = read_spz(tmp_path / "a.spz")
    ours = dict(zip(FIELDS, rows.T))
    assert found.bits == bits
    assert np.abs(found.points - rows[:, :3] * (1, -1, -1)).max() <= 0.5001 / 2**bits
    assert np.abs(found.opacity - 1 / (1 + np.exp(-ours["opacity"]))).max() <= 0.5001 / 255
    assert np.abs(found.color - rows[:, 6:9]).max() <= 0.5001 / 255 / 0.15
    assert np.abs(found.sizes - rows[:, 10:13]).max() <= 0.5001 / 16
    w, x, y, z = (ours[f"rot_{n}"] for n in range(4))
    same = np.abs((found.turns * np.stack([x, -y, -z, w], 1)).sum(1))
    assert same.min() > np.cos(0.002)  # of the half angle, rad: three numbers, each off by .0007 at most


def test_none_and_what_does_not_fit(tmp_path: Path) -> None:
    """No splats are a file of a header; the farthest coordinate keeps its sign where it is rounded up to the next bit; what is
    larger than a byte holds becomes the largest."""
    write_spz(tmp_path / "none.spz", splats(0, 1))
    assert len(read_spz(tmp_path / "none.spz").points) == 0
    rows = splats(1, 1)
    rows[:, :3], rows[:, 10:13] = 2**9 - 1e-9, 9
    write_spz(tmp_path / "far.spz", rows)
    found = read_spz(tmp_path / "far.spz")
    assert np.allclose(found.points, (512, -512, -512), atol=1e-3) and np.allclose(found.sizes, 255 / 16 - 10)


@pytest.mark.parametrize(("write", "off"), [(write_spz, 0.5), (write_splats, 0.25)])
def test_a_far_origin_is_warned_of(
    tmp_path: Path, write: Callable[[Path, np.ndarray], None], off: float, recwarn: pytest.WarningsRecorder
) -> None:
    """Oracle: half a step of 24 bits, and of float32, at 5,300 km (UTM); near the origin, and one far splat, are no matter."""
    rows = splats(400, 2)
    rows[:, 10:13], rows[0, 2] = np.log(0.01), 300
    write(tmp_path / "near", rows)
    assert not recwarn
    rows[:, 1] += 5.3e6
    write(tmp_path / "far", rows)
    (warning,) = recwarn
    assert "far: splats are moved by up to " in str(warning.message) and "5,300 km" in str(warning.message)
    assert float(re.search(r"up to (\S+) m", str(warning.message))[1]) == pytest.approx(off, rel=0.05)  # type: ignore[index]
