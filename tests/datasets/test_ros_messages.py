"""Messages of ROS that are packed (oracle: the published listing of the code)."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from dlama.datasets.captures.ros_messages import depth_of
from dlama.errors import FileError
from rosbag_writer import as_rvl


def test_depth_that_is_packed_by_rvl() -> None:
    """Oracle: the published listing; steps of all sizes and signs, and runs of nothing at the beginning, between and at the end.
    Damaged depth is named."""
    codes = np.random.default_rng(3).integers(0, 65536, (40, 50)).astype(np.uint16)
    codes[codes % 3 == 0], codes[:5], codes[20:22], codes[22, 10:14] = 0, 0, 0, (7, 65535, 1, 65535)
    for last in (0, 12):
        codes[-1] = last
        message = SimpleNamespace(format="16UC1; compressedDepth rvl", data=bytes(12) + as_rvl(codes))
        np.testing.assert_array_equal(depth_of(message, "a.bag, /d"), codes.astype(np.float32) / np.float32(1000))
    for data in (bytes(range(80)), message.data[:-40], message.data[:15], message.data[:20] + b"\xff" * 400):
        with pytest.raises(FileError, match=r"^a\.bag, /d, 16UC1; compressedDepth rvl: (is damaged|says it holds)"):
            depth_of(SimpleNamespace(format=message.format, data=data), "a.bag, /d")
