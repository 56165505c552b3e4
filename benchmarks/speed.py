"""Speed and memory, everything measured side by side in one run: rendering against Open3D, the main job, masks, start-up, 4K.

    python benchmarks/speed.py [--image street.jpg --depth depth.png --fov 90] [--skip-open3d] [--skip-4k] [--only-masks]

Medians over repeated runs after one warm-up; the ratio column is what counts, absolute times depend on the machine. The input
defaults to the demo frame that ships in the package.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import cv2
import numpy as np

import dlama
from dlama.completion.pipeline import complete
from dlama.geometry.camera import Camera
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD
from dlama.geometry.trajectories import orbit
from dlama.geometry.view import View

DEMO = Path(str(resources.files("dlama"))) / "assets" / "demo"
YAW = 20.0


def seconds(job: Callable[[], object], runs: int = 15) -> float:
    """Median wall time of a call after one warm-up."""
    job()
    taken = []
    for _ in range(runs):
        started = time.perf_counter()
        job()
        taken.append(time.perf_counter() - started)
    return statistics.median(taken)


def frame(image: Path, depth: Path, fov: float) -> RGBD:
    color = cv2.imread(str(image))[..., ::-1]
    millimetres = cv2.imread(str(depth), cv2.IMREAD_UNCHANGED)
    metres = millimetres.astype(np.float32) / 1000
    metres[millimetres == 65535] = np.inf
    height, width = metres.shape
    return RGBD(np.ascontiguousarray(color), metres, Camera.from_fov(width, height, fov))


def resized(rgbd: RGBD, width: int, height: int) -> RGBD:
    """The frame at another size (nearest depth, so that no new depths appear)."""
    color = cv2.resize(rgbd.color, (width, height), interpolation=cv2.INTER_CUBIC)
    depth = cv2.resize(rgbd.depth, (width, height), interpolation=cv2.INTER_NEAREST)
    return RGBD(color, depth, Camera.from_fov(width, height, rgbd.camera.fov_deg))


def open3d_projection(rgbd: RGBD, camera: Camera) -> Callable[[], object]:
    """Open3D's tensor RGBD -> cloud -> RGBD at the target camera."""
    import open3d as o3d

    o3c = o3d.core
    color = o3d.t.geometry.Image(o3c.Tensor(rgbd.color.astype(np.float32) / 255))
    depth = o3d.t.geometry.Image(o3c.Tensor(np.where(rgbd.valid, rgbd.depth, 0)[..., None].astype(np.float32)))
    picture = o3d.t.geometry.RGBDImage(color, depth)
    k = rgbd.camera.K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    intrinsics, extrinsics = o3c.Tensor(k), o3c.Tensor(camera.cam_from_world @ rgbd.camera.world_from_cam)

    def project() -> object:
        cloud = o3d.t.geometry.PointCloud.create_from_rgbd_image(picture, intrinsics, depth_scale=1.0, depth_max=1000.0)
        return cloud.project_to_rgbd_image(
            camera.width, camera.height, intrinsics, extrinsics, depth_scale=1.0, depth_max=1000.0
        )

    return project


def command_seconds(arguments: list[str], runs: int, **settings: str) -> float:
    taken = []
    for _ in range(runs):
        started = time.perf_counter()
        subprocess.run(arguments, check=True, capture_output=True, env={**os.environ, **settings})
        taken.append(time.perf_counter() - started)
    return statistics.median(taken)


def print_rendering(rgbd: RGBD, skip_open3d: bool) -> None:
    camera = orbit(rgbd.camera, YAW)
    source = View.from_rgbd(rgbd)
    print(f"\nrendering {rgbd.camera.width}x{rgbd.camera.height} to yaw {YAW:g} (ms)")
    other = None if skip_open3d else seconds(open3d_projection(rgbd, camera))
    if other is not None:
        print(f"  Open3D create_from_rgbd_image + project_to_rgbd_image {1000 * other:8.2f}")
    for mode, fine in (("points", False), ("surface", False), ("surface", True)):
        for types in (False, True):
            taken = seconds(lambda mode=mode, types=types, fine=fine: render(source, camera, mode, types, fine))
            ratio = f"   Open3D / dlama {other / taken:5.1f}x" if other else ""
            name = mode + (", bilinear" if mode == "surface" and not fine else "")
            print(f"  dlama {name:18} {'with hole types' if types else '':16} {1000 * taken:8.2f}{ratio}")


def print_view(rgbd: RGBD) -> float:
    camera = orbit(rgbd.camera, YAW)
    print(f"\nview in process, {rgbd.camera.width}x{rgbd.camera.height}, yaw {YAW:g} (s)")
    taken = 0.0
    for filler in ("telea", "navier-stokes", "layered"):
        taken = seconds(lambda filler=filler: complete(rgbd, [camera], filler=filler), runs=5)
        print(f"  {filler:14} {taken:7.3f}   {1e6 * taken / rgbd.depth.size:6.2f} us/pixel")
    return taken / rgbd.depth.size


def print_masks(rgbd: RGBD) -> None:
    """Wall and processor time, as other programs may run beside it; networks open, kernels compiled."""
    click = [(0.5 * rgbd.camera.width, 0.67 * rgbd.camera.height)]
    session = dlama.MaskSession(rgbd)
    known = [(*click[0], 3.0)]
    photo = dlama.estimate_depth(rgbd.color, rgbd.camera, metres_at=known).rgbd
    jobs: dict[str, Callable[[], object]] = {
        "mask by a click, with depth": lambda: dlama.find_mask(rgbd, clicks=click),
        "a further click (MaskSession)": lambda: session.find(clicks=click),
        "mask and shadow, with depth": lambda: dlama.find_mask(rgbd, clicks=click, with_shadow=True),
        "mask by a click, estimated depth": lambda: dlama.find_mask(photo, clicks=click),
        "depth of a photo": lambda: dlama.estimate_depth(rgbd.color, rgbd.camera, metres_at=known),
        "what stands out (salient)": lambda: dlama.find_mask(rgbd.color, masker="salient"),
    }
    print(f"\nmasks and depth of a photo, {rgbd.camera.width}x{rgbd.camera.height} (s)          processor")
    for name, job in jobs.items():
        job()
        walls, busy = [], []
        for _ in range(7):
            started = time.perf_counter(), time.process_time()
            job()
            walls.append(time.perf_counter() - started[0])
            busy.append(time.process_time() - started[1])
        print(f"  {name:34} {statistics.median(walls):7.3f} {statistics.median(busy):10.3f}")


def print_commands(image: Path, depth: Path, fov: float) -> None:
    print("\ncommands from a cold start (s)")
    command = [sys.executable, "-m", "dlama"]
    bare = command_seconds([sys.executable, "-c", "import numpy"], 5)
    imported = command_seconds([sys.executable, "-c", "import numpy, dlama"], 5)
    print(f"  import dlama, beyond numpy {imported - bare:7.3f}")
    print(f"  dlama --help               {command_seconds([*command, '--help'], 5):7.3f}")
    with tempfile.TemporaryDirectory() as folder:
        view = [*command, "view", str(image), str(depth), "--fov", str(fov), "--yaw", str(YAW), "-o", f"{folder}/out"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        first = command_seconds(view, 1, NUMBA_CACHE_DIR=f"{folder}/kernels")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        busy = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        print(f"  dlama view, first run ever {first:7.3f}   ({busy:.1f} s of processor time)")
        print(f"  dlama view, kernels cached {command_seconds(view, 4, NUMBA_CACHE_DIR=f'{folder}/kernels'):7.3f}")


def print_4k(rgbd: RGBD, per_pixel: float) -> None:
    large = resized(rgbd, 3840, 2160)
    camera = orbit(large.camera, YAW)
    started = time.perf_counter()
    complete(large, [camera])
    taken = time.perf_counter() - started
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"\n3840x2160, layered: {taken:.1f} s, {1e6 * taken / large.depth.size:.2f} us/pixel")
    print(
        f"  time per pixel against {rgbd.depth.shape[1]}x{rgbd.depth.shape[0]}: {taken / large.depth.size / per_pixel:.2f}x"
    )
    print(f"  peak memory of this process: {peak:.2f} GiB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--image", type=Path, default=DEMO / "street.jpg")
    parser.add_argument("--depth", type=Path, default=DEMO / "depth.png")
    parser.add_argument("--fov", type=float, default=90.0)
    parser.add_argument("--skip-open3d", action="store_true")
    parser.add_argument("--skip-4k", action="store_true")
    parser.add_argument("--skip-commands", action="store_true")
    parser.add_argument("--only-masks", action="store_true")
    args = parser.parse_args()
    rgbd = frame(args.image, args.depth, args.fov)
    if args.only_masks:
        print_masks(rgbd)
        return
    print_rendering(rgbd, args.skip_open3d)
    per_pixel = print_view(rgbd)
    print_masks(rgbd)
    if not args.skip_commands:
        print_commands(args.image, args.depth, args.fov)
    if not args.skip_4k:
        print_4k(rgbd, per_pixel)


if __name__ == "__main__":
    main()
