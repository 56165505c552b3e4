"""What `dlama doctor` says of good inputs, and of the same spoilt: a table of false alarms and of corruptions named.

    python benchmarks/doctor.py [--data FOLDER] [--worlds 100] [--every 4] [--only PART]

Good inputs: generated worlds, and with --data (or DLAMA_DATA) the pictures of that folder's data/ and street/. All of them are
looked at as they are, every n-th one spoilt in each of the ways of tests/corruptions.py. A corruption is named when one of the
checks that are meant for it is among the faults that are told; "first" when it is the first of them.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

import dlama
from dlama.datasets.layouts import open_dataset
from dlama.geometry.camera import Camera
from dlama.geometry.projection import depth_from_disparity
from dlama.perception.diagnosis.finding import Observed
from dlama.perception.diagnosis.frames.landing import SmallFrame, shrink
from dlama.perception.diagnosis.frames.odd_frames import find_odd_frames
from dlama.perception.diagnosis.frames.poses import check_poses
from dlama.perception.diagnosis.rgbd_checks import run_checks
from dlama.perception.diagnosis.stereo_pair import check_pair
from dlama.worlds.layouts.random_scene import build

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from corruptions import FRAMES, POSES, SPOILT, moved, observed

SIZE = 320
KINECT = Camera(640, 480, 526, 526, 320, 237)
BIN = Camera(640, 480, 619.871, 619.871, 314.241, 238.906)


def worlds(count: int) -> Iterator[tuple[str, Observed]]:
    """Streets and rooms from several cameras, each with its object as the mask."""
    for seed in range(1000, 1000 + count):
        rng = np.random.default_rng(seed)
        made = build(seed, None, ())
        camera = made.camera(float(rng.choice([0, 20, -30, 45])), SIZE, float(rng.choice([60, 75, 90])))
        seen = made.raycast(camera)
        mask = seen.group == made.object_index
        yield "worlds", observed(dlama.RGBD(seen.color, seen.depth, camera), mask if mask.any() else None)


def street(folder: Path) -> Iterator[tuple[str, Observed]]:
    """Every frame of every scene."""
    for sequence in sorted(folder.glob("s*/with*")):
        pictures = sequence / "CameraComponent"
        for color, depth in zip(
            sorted((pictures / "ColorImage").iterdir()), sorted((pictures / "DepthMM").iterdir()), strict=True
        ):
            yield "street", observed(dlama.read_rgbd(color, depth, fov=90))


def data(folder: Path) -> Iterator[tuple[str, Observed]]:
    """Kinect frames, the removal pair and the motorcycle."""
    for depth in sorted((folder / "kitchen_vpi").glob("*.depth.png")):
        color = depth.with_name(depth.name.replace(".depth.png", ".color.jpg"))
        yield "data", observed(dlama.read_rgbd(color, depth, camera=KINECT))
    sequence = folder / "kitchen_sequence"
    for color, depth in zip(
        sorted((sequence / "images").iterdir()), sorted((sequence / "depth").iterdir()), strict=True
    ):
        yield "data", observed(dlama.read_rgbd(color, depth, camera=KINECT))
    removal = folder / "bin_removal"
    for name in ("with", "without"):
        files = removal / f"{name}.color.png", removal / f"{name}.depth.png"
        rgbd = dlama.read_rgbd(*files, camera=BIN, depth_scale=10000)
        yield "data", observed(rgbd, dlama.read_mask(removal / "object_mask.png"))
    moto = folder / "motorcycle"
    lens = Camera(741, 500, 994.978, 994.978, 311.193, 254.877)
    disparity = np.load(moto / "disparity.npz")["disparity"]
    metres = depth_from_disparity(disparity, fx=lens.fx, baseline_m=0.193001, doffs=31.086)
    yield "data", observed(dlama.RGBD(dlama.read_color(moto / "left.png"), metres, lens))


def stereo_pairs(count: int, folder: Path | None) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Left, right and doffs: pairs of worlds, and of the folder."""
    for seed in range(2000, 2000 + count):
        made = build(seed, None, ())
        rig = made.rig(size=SIZE)
        yield made.raycast(rig.left).color, made.raycast(rig.right).color, 0.0
    if folder is not None:
        for pair in (
            folder / "data" / "stereo" / "cone",
            folder / "data" / "stereo" / "Cloth3",
            folder / "data" / "motorcycle",
        ):
            doffs = 31.086 if pair.name == "motorcycle" else 0.0
            yield dlama.read_color(pair / "left.png"), dlama.read_color(pair / "right.png"), doffs
        for scene in sorted(folder.glob("street/s*/stereo_with")):
            left, right = (dlama.read_color(next((scene / eye / "ColorImage").iterdir())) for eye in ("c0", "c1"))
            yield left, right, 0.0


def pair_table(pairs: list[tuple[np.ndarray, np.ndarray, float]]) -> None:
    """How many pairs are said to be what, good and spoilt."""
    told: dict[str, Counter[str]] = defaultdict(Counter)
    for number, (left, right, doffs) in enumerate(pairs):
        (height, width), other = left.shape[:2], pairs[number - 1][1]
        turn = cv2.getRotationMatrix2D((width / 2, height / 2), 1.5, 1)
        spoilt = {
            "good": (left, right),
            "swapped": (right, left),
            "identical": (left, left),
            "unrelated": (left, cv2.resize(other, (width, height))),
            "rows 0.8 % off": (left, np.roll(right, max(3, round(0.008 * width)), 0)),
            "turned by 1.5 degrees": (
                left,
                cv2.warpAffine(right, turn, (width, height), borderMode=cv2.BORDER_REFLECT),
            ),
        }
        for name, both in spoilt.items():
            faults = [each.check for each in check_pair(*both, doffs) if each.severity == "fault"]
            told[name]["+".join(faults) or "nothing"] += 1
    print(f"\nstereo pairs: {len(pairs)}")
    for name, counts in told.items():
        print(f"  {name}: {', '.join(f'{check} {count}' for check, count in counts.most_common())}")


def sequences(count: int, folder: Path | None) -> Iterator[tuple[str, list[dlama.RGBD]]]:
    """Frames in a row: of worlds by a camera that turns about all axes, and the Kinect's."""
    for seed in range(3000, 3000 + count):
        made, rng, frames = build(seed, None, ()), np.random.default_rng(seed), []
        for number in range(4):
            camera = dlama.orbit(made.camera(0, 192), 8.0 * number, 5.0 * number)
            hand = np.eye(4)
            hand[:3, :3] = cv2.Rodrigues(rng.normal(0, 0.05, 3) + np.array((0, 0, 0.08 * number)))[0]
            hand[:3, 3] = rng.normal(0, 0.05, 3)
            frames.append(made.frame(camera.at(camera.world_from_cam @ hand)))
        yield "worlds", frames
    if folder is not None:
        listed = open_dataset(folder / "data" / "kitchen_sequence").frames
        for start in range(0, len(listed) - 4, 5):
            yield "data", [frame.load() for frame in listed[start : start + 4]]


def pose_table(rows: list[tuple[str, list[dlama.RGBD]]]) -> None:
    """Named / tried for each convention."""
    told: dict[str, Counter[str]] = defaultdict(Counter)
    for source, frames in rows:
        told["good, false alarms"][f"{source} tried"] += 1
        told["good, false alarms"][source] += any(
            each.severity == "fault" for each in check_poses([shrink(one) for one in frames], "")
        )
        for name, (spoil, wanted) in POSES.items():
            told[name][f"{source} tried"] += 1
            told[name][source] += wanted in [
                each.check for each in check_poses([shrink(one) for one in moved(frames, spoil)], "")
            ]
    print("\nposes, named / tried")
    for name, counts in told.items():
        print(
            f"  {name}: "
            + ", ".join(f"{each} {counts[each]} / {counts[f'{each} tried']}" for each in ("worlds", "data"))
        )


def odd_rows(count: int, folder: Path | None) -> Iterator[tuple[str, list[SmallFrame], list[dlama.RGBD]]]:
    """Posed frames of one scene: orbits in worlds, and the folder's sequences."""
    loaded = []
    for seed in range(4000, 4000 + count):
        made = build(seed, None, ())
        cameras = (dlama.orbit(made.camera(0, 192), 8.0 * number, 3.0 * number) for number in range(6))
        loaded.append(("worlds", [made.frame(camera) for camera in cameras]))
    if folder is not None:
        names = [
            f"data/{name}" for name in ("dining_vpi", "kitchen_sequence", "kitchen_vpi", "shelf_sequence", "table_vpi")
        ]
        for name in (*names, *(f"street/s0{number}" for number in (3, 5, 6, 8))):
            frames = open_dataset(folder / name).frames
            loaded.append((name.partition("/")[0], [each.load() for each in frames if "without" not in each.name]))
    for source, frames in loaded:
        yield source, [shrink(frame) for frame in frames], frames


def odd_table(rows: Iterator[tuple[str, list[SmallFrame], list[dlama.RGBD]]]) -> None:
    """Each frame spoilt on its own: named alone and rightly / tried; and frames named in good scenes."""
    told: dict[str, Counter[str]] = defaultdict(Counter)
    for source, small, frames in rows:
        names = [str(number) for number in range(len(small))]
        told["good, frames named"][f"{source} tried"] += len(small)
        told["good, frames named"][source] += len(find_odd_frames(small, names))
        for name, (spoil, wanted, _) in FRAMES.items():
            for number in range(0, len(small), max(1, len(small) // 4)):
                spoilt = [*small[:number], shrink(spoil(frames[number])), *small[number + 1 :]]
                found = [(each.check, each.what.partition(":")[0]) for each in find_odd_frames(spoilt, names)]
                told[name][f"{source} tried"] += 1
                told[name][source] += found == [(wanted, str(number))]
                told[name][f"{source} others"] += any(other != str(number) for _, other in found)
    print("\none odd frame of many, named / tried (runs in which another frame was named)")
    for name, counts in told.items():
        shares = (
            f"{each} {counts[each]} / {counts[f'{each} tried']} ({counts[f'{each} others']})"
            for each in ("worlds", "data", "street")
        )
        print(f"  {name}: {', '.join(shares)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=os.environ.get("DLAMA_DATA"))
    parser.add_argument("--worlds", type=int, default=100)
    parser.add_argument("--every", type=int, default=4)
    parser.add_argument("--only", choices=("pictures", "pairs", "poses", "frames"), help="one of the four parts")
    options = parser.parse_args()
    folder = None if options.data is None else Path(options.data)
    if options.only in (None, "pairs"):
        pair_table(list(stereo_pairs(options.worlds * 3 // 10, folder)))
    if options.only in (None, "poses"):
        pose_table(list(sequences(options.worlds * 3 // 10, folder)))
    if options.only in (None, "frames"):
        odd_table(odd_rows(options.worlds * 3 // 10, folder))
    if options.only in (None, "pictures"):
        pictures(options.worlds, folder, options.every)


def pictures(count: int, folder: Path | None, every: int) -> None:
    """False alarms and corruptions named of pictures with depth."""
    good, alarms, spoilt = Counter[str](), Counter[str](), defaultdict[tuple[str, str], Counter[str]](Counter)
    inputs = list(worlds(count))
    if folder is not None:
        inputs += [*data(folder / "data"), *street(folder / "street")]
    for number, (source, seen) in enumerate(inputs):
        good[source] += 1
        told = [finding.line for finding in run_checks(seen) if finding.severity == "fault"]
        alarms[source] += bool(told)
        for line in told:
            print(f"false alarm, {source} {number}: {line}", flush=True)
        if number % every:
            continue
        for name, (spoil, wanted) in SPOILT.items():
            if "mask" in name and seen.mask is None:
                continue
            named = [finding.check for finding in run_checks(spoil(seen)) if finding.severity == "fault"]
            found = spoilt[name, source]
            found["tried"] += 1
            found["named"] += bool(set(named) & set(wanted))
            found["first"] += bool(named) and named[0] in wanted
            found["told"] += bool(named)
    table(good, alarms, spoilt)


def table(good: Counter[str], alarms: Counter[str], spoilt: dict[tuple[str, str], Counter[str]]) -> None:
    """Markdown: a row for good inputs, then one for each corruption; named / tried for each source."""
    sources = list(good)
    print(f"\n| | {' | '.join(sources)} | all |\n|---|{'---|' * (len(sources) + 1)}")
    shares = [f"{alarms[each]} / {good[each]}" for each in sources]
    print(f"| good, false alarms | {' | '.join(shares)} | {sum(alarms.values()) / sum(good.values()):.1%} |")
    total: Counter[str] = Counter()
    for name in SPOILT:
        row = [spoilt[name, each] for each in sources]
        both = sum(row, Counter[str]())
        total += both
        cells = [f"{each['named']} / {each['tried']}" for each in row]
        print(f"| {name} | {' | '.join(cells)} | {both['named'] / max(both['tried'], 1):.0%} |")
    print(f"\nnamed {total['named']} of {total['tried']} ({total['named'] / total['tried']:.1%}); as the first finding "
          f"{total['first'] / total['tried']:.1%}; some fault told {total['told'] / total['tried']:.1%}")  # fmt: skip


if __name__ == "__main__":
    main()
