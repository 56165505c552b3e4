"""The kernels that jobs on the bundled street, on a photo, a frame of a depth camera and posed frames call, with their types:
the lines of src/dlama/assets/kernels.txt, which `dlama warm-up` and the first run compile from.

    DLAMA_DATA=FOLDER python benchmarks/kernels.py > src/dlama/assets/kernels.txt
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numba.core.types import Array, BaseNamedTuple, BaseTuple

import dlama
from dlama.geometry.kernels.jit import KernelCache
from dlama.perception.resampling import upsample_depth
from dlama.worlds.dataset import world
from speed import kinect_frame, photo

STREET = dlama.example()


def street() -> dlama.RGBD:
    """The bundled picture with its depth."""
    return dlama.read_rgbd(STREET / "street.jpg", STREET / "depth.png", fov=90)


def view() -> list[dlama.Completion]:
    """A view of rendered depth."""
    return [dlama.view(street(), yaw=20)]


def remove() -> list[dlama.Completion]:
    """Objects removed, by a mask and by a click, seen from the same place and from elsewhere."""
    rgbd, mask = street(), dlama.read_mask(STREET / "mask.png")
    clicked = dlama.find_mask(rgbd, clicks=[(256, 340)], with_shadow=True).mask
    return [dlama.remove(rgbd, mask), dlama.remove(rgbd, clicked, yaw=10)]


def stereo() -> list[dlama.Completion]:
    """A pair without an object."""
    left, right = (dlama.read_color(STREET / name) for name in ("street.jpg", "right.jpg"))
    mask = dlama.read_mask(STREET / "mask.png")
    return [dlama.stereo(left, right, dlama.read_stereo_calib(STREET / "calib.txt"), mask=mask)]


def of_photo() -> list[dlama.Completion]:
    """A photo without depth: a view, and a removal."""
    color = photo(600)
    estimate = dlama.estimate_depth(color)
    mask = dlama.find_mask(estimate.rgbd, clicks=[(300, 250)]).mask
    return [dlama.view(estimate.rgbd, yaw=8), dlama.remove(estimate.rgbd, mask)]


def of_frame() -> list[dlama.Completion]:
    """A frame of a depth camera: a view, and a removal."""
    frame = kinect_frame()
    return [dlama.view(frame, yaw=20), dlama.remove(frame, dlama.find_mask(frame, clicks=[(320, 240)]).mask)]


def photo3d() -> list[dlama.Completion]:
    """A 3-D photo, written."""
    with tempfile.TemporaryDirectory() as folder:
        dlama.write_photo3d(dlama.photo3d(street()), Path(folder) / "out")
    return []


def sequence() -> list[dlama.Completion]:
    """A pair's two pictures as posed frames, an object removed from both."""
    left, right = (dlama.read_color(STREET / name) for name in ("street.jpg", "right.jpg"))
    pair = dlama.stereo(left, right, dlama.read_stereo_calib(STREET / "calib.txt"))
    frames = [dlama.RGBD(view.color, view.depth, view.camera) for view in pair.views]
    return [dlama.complete(frames, [frame.camera for frame in frames], mask={0: dlama.read_mask(STREET / "mask.png")})]


def of_worlds() -> list[dlama.Completion]:
    """A picture of a procedural world, its depth enlarged to its size."""
    made = world(0)
    frame = made.frame(made.camera(0, 64))
    upsample_depth(np.ascontiguousarray(frame.depth[::2, ::2]), frame.color)
    return []


JOBS: dict[str, Callable[[], list[dlama.Completion]]] = {
    "view": view,
    "remove": remove,
    "stereo": stereo,
    "photo": of_photo,
    "frame": of_frame,
    "photo3d": photo3d,
    "sequence": sequence,
    "worlds": of_worlds,
}


@contextmanager
def called() -> Iterator[list[str]]:
    """`module:name types` of the kernels that are called meanwhile for the first time in this process, in that order."""
    found: list[str] = []
    load = KernelCache.load_overload

    def note(cache: Any, signature: Any, target: Any) -> Any:
        function = cache._py_func
        found.append(f"{function.__module__}:{function.__name__} {' '.join(map(word, signature))}")
        return load(cache, signature, target)

    KernelCache.load_overload = note
    yield found


def word(kind: object) -> str:
    """A type as `numba_type` reads it."""
    if isinstance(kind, Array):
        return f"{kind.dtype}.{kind.ndim}{kind.layout}{'' if kind.mutable else 'r'}"
    if isinstance(kind, BaseNamedTuple):
        own = kind.instance_class
        return f"{own.__module__}:{own.__name__}({','.join(map(word, kind.types))})"
    return f"({','.join(map(word, kind.types))})" if isinstance(kind, BaseTuple) else str(kind)


def main() -> None:
    """All jobs, each in a process of its own; or one, whose kernels are printed in the order of their first call."""
    warnings.simplefilter("ignore")
    if len(sys.argv) > 1:
        with called() as found, tempfile.TemporaryDirectory() as folder:
            for done in JOBS[sys.argv[1]]():
                dlama.write(done, folder)
        print("\n".join(found))
        return
    jobs: dict[str, list[str]] = {}
    for job in JOBS:
        line = [sys.executable, __file__, job]
        for kernel in subprocess.run(
            line, check=True, capture_output=True, text=True, env=os.environ
        ).stdout.splitlines():
            jobs.setdefault(kernel, []).append(job)
    print("\n".join(f"{','.join(names)} {kernel}" for kernel, names in jobs.items()))


if __name__ == "__main__":
    main()
