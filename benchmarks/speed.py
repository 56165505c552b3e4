"""Times, peak memory and bytes written of the main jobs; against another commit, the two run in turn and give ratios.

    python benchmarks/speed.py                                 # every row of this checkout, once
    python benchmarks/speed.py --against 9b78cf1 --rounds 3    # ratios against that commit, with their spread
    python benchmarks/speed.py --rows help photo-12mp          # some rows; --list names them
    python benchmarks/speed.py --chart photo.svg               # time, memory and files of a photo of 1, 4, 11 and 24 megapixels

Each row runs in a process of its own, whose kernels are compiled before it is timed. `--against` unpacks the commit
(`git archive`), runs it with the same packages, in turns A B B A, and prints the ratio new / old of each pair: median, least and
largest. Processor time counts, as other programs may run on the machine. Real data are read from the folder in DLAMA_DATA.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import resource
import statistics
import subprocess
import sys
import tarfile
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve()
ROOT = Path(__file__).resolve().parents[1]
PIVOT = 2.5
"""Metres that views turn about; what is chosen where none is given has changed between versions."""
Figures = dict[str, float]
"""Name of a figure -> its value: processor seconds, or what the name says."""


def demo_frame(width: int = 512, height: int = 512) -> Any:
    """The frame that ships, at another size: depth by the nearest pixel, so that no new depths appear."""
    import cv2
    import numpy as np

    import dlama

    folder = Path(dlama.__file__).parent / "assets" / "demo"
    color = cv2.imread(str(folder / "street.jpg"))[..., ::-1]
    units = cv2.imread(str(folder / "depth.png"), cv2.IMREAD_UNCHANGED)
    metres = np.where(units == 65535, np.float32(np.inf), units.astype(np.float32) / 1000)
    color = cv2.resize(color, (width, height), interpolation=cv2.INTER_CUBIC)
    metres = cv2.resize(metres, (width, height), interpolation=cv2.INTER_NEAREST)
    return dlama.RGBD(np.ascontiguousarray(color), metres, dlama.Camera.from_fov(width, height, 90))


def kinect_frame() -> Any:
    """A frame of a depth camera, 640x480. KeyError without DLAMA_DATA."""
    import dlama

    stem = Path(os.environ["DLAMA_DATA"]) / "data" / "kitchen_vpi" / "frame-000024"
    camera = dlama.Camera(640, 480, 526, 526, 320.5, 237.5)
    return dlama.read_rgbd(f"{stem}.color.jpg", f"{stem}.depth.png", camera=camera)


def photo(width: int) -> Any:
    """A photo of that width, 3:2. KeyError without DLAMA_DATA."""
    import cv2
    import numpy as np

    found = cv2.imread(str(Path(os.environ["DLAMA_DATA"]) / "photos" / "more" / "bench.jpg"))
    large = cv2.resize(found, (width, 2 * width // 3), interpolation=cv2.INTER_CUBIC)
    return np.ascontiguousarray(large[..., ::-1])


def frames(count: int) -> Figures:
    """The frames of a kitchen by a depth camera, 640x480, completed at as many cameras between them; and a view of eight frames
    drawn, not filled. KeyError without DLAMA_DATA."""
    import dlama
    from dlama.datasets.sequences.loading import read_scene_of

    scene = read_scene_of(Path(os.environ["DLAMA_DATA"]) / "data" / "kitchen_sequence", f"0:{count}").scene
    cameras = [dlama.orbit(frame.camera, 3.0, 0.0, 2.0) for frame in scene.frames]
    dlama.complete(scene, cameras[:1])
    with (lap := Laps())("cpu"):
        dlama.complete(scene, cameras)
    view = repeated(lambda: dlama.render(scene, cameras[count // 2]), 5)
    return lap.figures | {f"a view, {name}": seconds for name, seconds in view.items()}


def path() -> Figures:
    """A picture of a video of a path, 640x480, round a frame of a depth camera, once the scene is filled. KeyError as above."""
    import dlama

    rgbd = kinect_frame()
    cameras = [dlama.orbit(rgbd.camera, -10 + 20 * n / 23, 0.0, 2.0) for n in range(24)]
    views = dlama.render_path(dlama.complete(rgbd, [rgbd.camera]).scene, cameras)
    next(views)
    with (lap := Laps())("cpu"):
        left = sum(1 for _ in views)
    return {name: seconds / left for name, seconds in lap.figures.items()}


class Laps:
    """Processor time by stage."""

    def __init__(self) -> None:
        self.figures: Figures = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        begun, busy = time.perf_counter(), time.process_time()
        yield
        self.figures[name] = time.process_time() - busy
        self.figures["wall"] = self.figures.get("wall", 0) + time.perf_counter() - begun


def repeated(job: Callable[[], object], runs: int) -> Figures:
    """Processor and wall time of a call, medians of some runs after one that is not counted."""
    job()
    laps = [Laps() for _ in range(runs)]
    for lap in laps:
        with lap("cpu"):
            job()
    return {name: statistics.median(lap.figures[name] for lap in laps) for name in ("cpu", "wall")}


def view(frame: Callable[[], Any], filler: str = "layered", runs: int = 1) -> Figures:
    """A view in process, yaw 20 about PIVOT, so that every version draws the same; a small one compiles the kernels first."""
    import dlama

    dlama.view(demo_frame(256, 256), yaw=20, pivot=PIVOT, filler=filler)
    rgbd = frame()
    if runs > 1:
        return repeated(lambda: dlama.view(rgbd, yaw=20, pivot=PIVOT, filler=filler), runs)
    with (lap := Laps())("cpu"):
        dlama.view(rgbd, yaw=20, pivot=PIVOT, filler=filler)
    return lap.figures


def removal_of_photo(width: int) -> Figures:
    """Depth, a click, its removal and all files of a photo; stage by stage."""
    import dlama

    def run(color: Any, folder: str, lap: Laps) -> None:
        with lap("depth"):
            estimate = dlama.estimate_depth(color)
        with lap("click"):
            found = dlama.find_mask(estimate.rgbd, clicks=[(0.5 * color.shape[1], 0.62 * color.shape[0])])
        with lap("removal"):
            done = dlama.remove(estimate.rgbd, found.mask)
        with lap("write"):
            dlama.write(done, folder)

    with tempfile.TemporaryDirectory() as folder:
        run(photo(600), f"{folder}/small", Laps())
        run(photo(width), f"{folder}/large", lap := Laps())
        return lap.figures | written(Path(folder) / "large")


def written(folder: Path) -> Figures:
    """Megabytes of the files in a folder."""
    return {"MB written": sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) / 1e6}


def rendering(mode: str, types: bool, fine: bool = True) -> Figures:
    """The demo frame drawn to yaw 20; where Open3D is installed the share of its projection's time, too. fine: by splines."""
    from dlama import orbit
    from dlama.geometry.rendering import render
    from dlama.geometry.view import View

    rgbd = demo_frame()
    source, camera = View.from_rgbd(rgbd), orbit(rgbd.camera, 20)
    figures = repeated(lambda: render(source, camera, mode, types, fine), 25)  # type: ignore[arg-type]
    try:
        other = repeated(open3d_projection(rgbd, camera), 25)
    except ImportError:
        return figures
    return figures | {"times as fast as Open3D": other["wall"] / figures["wall"]}


def open3d_projection(rgbd: Any, camera: Any) -> Callable[[], object]:
    """Open3D's tensor RGBD -> cloud -> RGBD at the target camera."""
    import numpy as np
    import open3d as o3d

    o3c = o3d.core
    color = o3d.t.geometry.Image(o3c.Tensor(rgbd.color.astype(np.float32) / 255))
    depth = o3d.t.geometry.Image(o3c.Tensor(np.where(rgbd.valid, rgbd.depth, 0)[..., None].astype(np.float32)))
    picture = o3d.t.geometry.RGBDImage(color, depth)
    intrinsics = o3c.Tensor(rgbd.camera.K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]))
    extrinsics = o3c.Tensor(camera.cam_from_world @ rgbd.camera.world_from_cam)
    limits = {"depth_scale": 1.0, "depth_max": 1000.0}

    def project() -> object:
        cloud = o3d.t.geometry.PointCloud.create_from_rgbd_image(picture, intrinsics, **limits)
        return cloud.project_to_rgbd_image(camera.width, camera.height, intrinsics, extrinsics, **limits)

    return project


def masks() -> Figures:
    """A click in a frame with depth, and one in a photo."""
    import dlama

    rgbd = demo_frame()
    estimated = dlama.estimate_depth(rgbd.color, rgbd.camera).rgbd
    click = [(0.5 * rgbd.camera.width, 0.67 * rgbd.camera.height)]
    found = {"with depth": rgbd, "photo": estimated}
    return {name: repeated(lambda one=one: dlama.find_mask(one, clicks=click), 5)["cpu"] for name, one in found.items()}


def stereo() -> Figures:
    """The demo pair: disparity, and both pictures without the car."""
    import cv2

    import dlama

    folder = Path(dlama.__file__).parent / "assets" / "demo"
    pair = [cv2.imread(str(folder / name))[..., ::-1].copy() for name in ("street.jpg", "right.jpg")]
    calibration = dlama.read_stereo_calib(folder / "calib.txt")
    mask = cv2.imread(str(folder / "mask.png"), 0) > 127
    return repeated(lambda: dlama.stereo(*pair, calibration, mask=mask), 2)


def command(*words: str, runs: int = 5, cached: bool = True) -> Figures:
    """A command from a cold start, its children counted; `cached`: its kernels were compiled before."""
    import dlama

    demo = Path(dlama.__file__).parent / "assets" / "demo"
    taken, sizes = [], {}
    with tempfile.TemporaryDirectory() as folder:
        line = [sys.executable, "-m", "dlama", *(word.format(demo=demo, out=f"{folder}/out") for word in words)]
        settings = os.environ | {"PYTHONPYCACHEPREFIX": f"{folder}/bytecode"}  # as an installed package has it
        settings.pop("PYTHONDONTWRITEBYTECODE", None)
        subprocess.run(line, check=True, capture_output=True, env=settings)
        settings |= {} if cached else {"NUMBA_CACHE_DIR": f"{folder}/kernels"}
        for _ in range(runs):
            begun, busy = time.perf_counter(), children()
            subprocess.run(line, check=True, capture_output=True, env=settings)
            taken.append((time.perf_counter() - begun, children() - busy))
        if Path(folder, "out").exists():
            sizes = written(Path(folder) / "out")
    wall, cpu = (statistics.median(one) for one in zip(*taken))
    return {"cpu": cpu, "wall": wall} | sizes


def children() -> float:
    """Processor seconds of the processes that this one has started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


VIEW = (
    "view",
    "{demo}/street.jpg",
    "{demo}/depth.png",
    "--fov",
    "90",
    "--yaw",
    "20",
    "--pivot",
    str(PIVOT),
    "-o",
    "{out}",
)
ROWS: dict[str, Callable[[], Figures]] = {
    "help": lambda: command("--help"),
    "verb-help": lambda: command("view", "--help"),
    "command": lambda: command(*VIEW, runs=3),
    "first-run": lambda: command(*VIEW, runs=1, cached=False),
    "points": lambda: rendering("points", False),
    "points-types": lambda: rendering("points", True),
    "surface": lambda: rendering("surface", False),
    "surface-types": lambda: rendering("surface", True),
    "surface-bilinear": lambda: rendering("surface", False, fine=False),
    "surface-bilinear-types": lambda: rendering("surface", True, fine=False),
    "view-512-telea": lambda: view(demo_frame, "telea", 3),
    "view-512-layered": lambda: view(demo_frame, "layered", 3),
    "view-512-auto": lambda: view(demo_frame, "auto", 3),
    "view-kinect": lambda: view(kinect_frame, "auto", 2),
    "view-1080p": lambda: view(lambda: demo_frame(1920, 1080), "auto"),
    "view-4k": lambda: view(lambda: demo_frame(3840, 2160), "auto"),
    "view-12mp": lambda: view(lambda: demo_frame(4000, 3000), "layered"),
    "frames-12": lambda: frames(12),
    "frames-49": lambda: frames(49),
    "path": path,
    "masks": masks,
    "stereo": stereo,
    "photo-1mp": lambda: removal_of_photo(1225),
    "photo-2mp": lambda: removal_of_photo(1600),
    "photo-4mp": lambda: removal_of_photo(2450),
    "photo-12mp": lambda: removal_of_photo(4000),
    "photo-24mp": lambda: removal_of_photo(6000),
}
"""Name -> what measures it, in a process of its own."""
PHOTOS = {"photo-1mp": 1.0, "photo-4mp": 4.0, "photo-12mp": 10.7, "photo-24mp": 24.0}
"""Row -> megapixels of the photo."""


def measure(row: str) -> Figures:
    """One row in this process, with the peak of its memory and of its children's."""
    warnings.simplefilter("ignore")
    figures = ROWS[row]()
    peaks = (resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return figures | {"peak GB": max(peaks) * 1024 / 1e9}


def in_checkout(source: Path, row: str) -> Figures | None:
    """One row measured in a process that imports dlama from `source`; None where it fails, with its last line printed."""
    line = [sys.executable, str(HERE), "--measure", row]
    ended = subprocess.run(line, env=os.environ | {"PYTHONPATH": str(source)}, capture_output=True, text=True)
    if ended.returncode:
        print(f"{row}: {ended.stderr.strip().splitlines()[-1]}", file=sys.stderr)
        return None
    found: Figures = json.loads(ended.stdout.splitlines()[-1])
    return found


@contextmanager
def unpacked(commit: str) -> Iterator[Path]:
    """The files of a commit of this repository, for as long as they are needed."""
    packed = subprocess.run(["git", "archive", commit], check=True, capture_output=True, cwd=ROOT)
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
            archive.extractall(folder, filter="data")
        yield Path(folder)


def draw_chart(path: Path) -> None:
    """Processor seconds, peak memory and bytes written of the removal from a photo against its megapixels, as an SVG."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.fonttype"] = "none"
    matplotlib.rcParams["svg.hashsalt"] = "dlama"
    from matplotlib import pyplot

    found = {pixels: in_checkout(ROOT / "src", row) for row, pixels in PHOTOS.items()}
    panels = {
        "processor seconds": ("depth", "click", "removal", "write"),
        "peak memory, GB": ("peak GB",),
        "files, MB": ("MB written",),
    }
    figure, axes = pyplot.subplots(1, len(panels), figsize=(9, 2.6), layout="constrained")
    for plot, (title, names) in zip(axes, panels.items()):
        values = {pixels: sum(one[name] for name in names) for pixels, one in found.items() if one is not None}
        print(title, values)
        plot.plot(list(values), list(values.values()), "o-", color="#1f6fb2")
        plot.set(title=title, xlabel="megapixels", xlim=(0, None), ylim=(0, None))
        plot.grid(alpha=0.3)
    figure.savefig(path, metadata={"Date": None})


def compare(row: str, new: Path, old: Path, rounds: int) -> None:
    """A row of both checkouts in turn, and the ratio new / old of each pair."""
    pairs: list[tuple[Figures, Figures]] = []
    for number in range(rounds + 1):  # the first compiles
        first, second = ((new, old), (old, new))[number % 2]
        found = {first: in_checkout(first, row), second: in_checkout(second, row)}
        a, b = found[new], found[old]
        if a is None or b is None:
            return
        if number:
            pairs.append((a, b))
    for name in pairs[0][0]:
        a, b = (statistics.median(pair[side][name] for pair in pairs) for side in (0, 1))
        ratios = sorted(pair[0][name] / max(pair[1][name], 1e-9) for pair in pairs)
        spread = f"{statistics.median(ratios):6.2f}   {ratios[0]:5.2f} to {ratios[-1]:5.2f}"
        print(f"{row:18} {name:24} {b:9.3f} {a:9.3f} {spread}", flush=True)


def main() -> None:
    """Rows of this checkout, or their ratios against a commit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", metavar="COMMIT")
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS))
    parser.add_argument("--rounds", type=int, default=3, help="pairs that are counted; one more warms up")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--chart", type=Path, metavar="FILE")
    parser.add_argument("--measure", choices=ROWS, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.list:
        print("\n".join(ROWS))
    elif given.measure:
        print(json.dumps(measure(given.measure)))
    elif given.chart is not None:
        draw_chart(given.chart)
    elif given.against is None:
        for row in given.rows:
            figures = in_checkout(ROOT / "src", row) or {}
            print(f"{row:18} " + "   ".join(f"{name} {value:.3f}" for name, value in figures.items()), flush=True)
    else:
        with unpacked(given.against) as old:
            print(f"{'row':18} {'figure':24} {given.against[:9]:>9} {'here':>9}  ratio   spread")
            for row in given.rows:
                compare(row, ROOT / "src", old / "src", given.rounds)


if __name__ == "__main__":
    main()
