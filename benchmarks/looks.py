"""Pictures of hard cases as they are completed: real frames, cut depth, removals, views; next to the truth where there is one.

    python benchmarks/looks.py ../shared -o now                  # one PNG a case, and its numbers
    python benchmarks/looks.py --sheet now -o docs/images/gallery.jpg  # known | completed | truth of one such folder, all of it

The cases are chosen by kind, not by result: a Kinect's room at about 10, 20, 30 and 40 degrees, the same room from 10 and 15
degrees next to frames of a sequence, objects in it that are clicked and removed with their shadow (last: the frame itself), a
bin with objects removed, a street of which an object is removed, streets from elsewhere, the same with depth that ends at
10 m, and the scene that comes with dlama, painted by MI-GAN. Numbers: squared colour error in what was a hole, and seconds of
processor time.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np

import dlama
from dlama.completion.pipeline import Completion, complete
from dlama.datasets.frames import RemovalTruth, ViewTruth
from dlama.datasets.layouts import open_dataset
from dlama.geometry.rgbd import RGBD, UInt8Array

CUT_M = 10.0
"""Where EasySynth's depth ends by default."""
CLICKS = {
    "40": (229, 205),
    "9": (473, 208),
    "22": (282, 367),
    "33": (392, 240),
    "16": (212, 116),
    "37": (374, 243),
    "5": (293, 194),
}
"""Number of a frame of kitchen_sequence -> a pixel of an object in it."""
TURNS = (("10", -15), ("10", 10), ("26", 10), ("33", -15), ("33", 10), ("41", -15), ("41", 10))
"""Number of a frame of kitchen_sequence, and degrees of yaw about the middle of what it shows."""
CELL = 160
"""Width of a picture on the sheet."""

Case = Callable[[], tuple[Completion, UInt8Array | None]]


def cut(rgbd: RGBD) -> RGBD:
    """The same with everything at or beyond CUT_M said to be far."""
    return dataclasses.replace(rgbd, depth=np.where(rgbd.depth >= CUT_M, np.float32(np.inf), rgbd.depth))


def seen_from(truth: ViewTruth, *, ends: bool = False, **settings: str) -> tuple[Completion, UInt8Array]:
    source = cut(truth.source) if ends else truth.source
    return complete(source, [truth.target.camera], **settings), truth.target.color


def without(truth: RemovalTruth, *, ends: bool = False, **settings: str) -> tuple[Completion, UInt8Array]:
    source = cut(truth.source) if ends else truth.source
    return complete(source, [source.camera], mask=truth.mask, **settings), truth.without.color


def clicked(frame: RGBD, at: tuple[int, int]) -> tuple[Completion, UInt8Array]:
    """The frame without the object at a pixel and its shadow, and the frame."""
    return dlama.remove(frame, dlama.find_mask(frame, clicks=[at], with_shadow=True).mask), frame.color


def demo(yaw: float | None, filler: str) -> tuple[Completion, None]:
    street = dlama.example()
    rgbd = dlama.read_rgbd(street / "street.jpg", street / "depth.png", camera=street / "camera.json")
    if yaw is not None:
        return dlama.view(rgbd, yaw=yaw, filler=filler), None
    return dlama.remove(rgbd, dlama.read_mask(street / "mask.png"), filler=filler), None


def cases(shared: Path) -> Iterator[tuple[str, Case]]:
    """Name and how to complete it, in the order of the sheet."""
    for number, case in enumerate(open_dataset(shared / "data/kitchen_vpi").cases):
        yield f"kitchen-{number}-{case.yaw:.0f}deg", lambda case=case: seen_from(case.load())
        if number in (0, 4):
            yield f"kitchen-{number}-migan", lambda case=case: seen_from(case.load(), filler="migan")
    frames = open_dataset(shared / "data/kitchen_sequence").frames
    for number, at in CLICKS.items():
        yield f"room-{number}-click", lambda frame=frames[int(number)], at=at: clicked(frame.load(), at)
    for number, yaw in TURNS:
        frame = frames[int(number)]
        yield (
            f"room-{number}-yaw{yaw:+d}",
            lambda frame=frame, yaw=yaw: (dlama.view(frame.load(), yaw=yaw, pivot="auto"), None),
        )
    bin_case = open_dataset(shared / "data/bin_removal").cases[0]
    yield "bin-removal", lambda: without(bin_case.load())
    for scene in ("s03", "s05", "s06", "s08"):
        streets = open_dataset(shared / "street", scenes=[scene]).cases
        removal = next(c for c in streets if c.protocol == "ori")
        yield f"{scene}-removal", lambda case=removal: without(case.load())
        for case in (c for c in streets if c.protocol == "vpi" and c.yaw in (20, -20, 40)):
            yield f"{scene}-yaw{case.yaw:+.0f}", lambda case=case: seen_from(case.load())
        if scene in ("s05", "s06"):
            yield f"{scene}-cut-removal", lambda case=removal: without(case.load(), ends=True)
            turned = next(c for c in streets if c.protocol == "vpi" and c.yaw == 20)
            yield f"{scene}-cut-yaw+20", lambda case=turned: seen_from(case.load(), ends=True)
    for yaw in (20, -20, 40):
        yield f"demo-migan-yaw{yaw:+d}", lambda yaw=yaw: demo(yaw, "migan")
        yield f"demo-yaw{yaw:+d}", lambda yaw=yaw: demo(yaw, "layered")


def picture(done: Completion, truth: UInt8Array | None) -> UInt8Array:
    """What was known | what came out | the truth, or nothing."""
    known = done.warped[-1]
    shown = np.where(known.color_hole[..., None], np.uint8(255), known.color)
    return np.hstack([shown, done.view.color, np.zeros_like(shown) if truth is None else truth])


def make(shared: Path, out: Path, expected: list[str]) -> None:
    out.mkdir(parents=True, exist_ok=True)
    for name, case in cases(shared):
        if expected and not any(part in name for part in expected):
            continue
        started = time.process_time()
        done, truth = case()
        seconds, hole = time.process_time() - started, done.warped[-1].color_hole
        error = np.nan if truth is None else float(((done.view.color.astype(float) - truth)[hole] ** 2).mean())
        print(f"{name:24} hole {hole.mean():5.1%}  squared error {error:7.0f}  {seconds:5.2f} s", flush=True)
        cv2.imwrite(str(out / f"{name}.png"), picture(done, truth)[..., ::-1])


def lay_out(folder: Path, sheet: Path, expected: list[str]) -> None:
    """One row a case: known | completed | truth; two cases a row."""
    files = [
        file for file in sorted(folder.glob("*.png")) if not expected or any(part in file.stem for part in expected)
    ]
    if not files:
        sys.exit(f"{folder} holds no pictures of these names")
    write_sheet([labelled(cv2.imread(str(file)), file.stem) for file in files], sheet)


def labelled(row: UInt8Array, name: str) -> UInt8Array:
    """Three pictures at the sheet's size, the name of their case in the first."""
    height = round(3 * CELL * row.shape[0] / row.shape[1])
    small = cv2.resize(row, (3 * CELL, height), interpolation=cv2.INTER_AREA)
    return cv2.putText(small, name, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 255), 1, cv2.LINE_AA)


def write_sheet(rows: list[UInt8Array], sheet: Path) -> None:
    """Two cases a row; a JPEG is kept small."""
    while len(rows) % 2:
        rows.append(np.zeros_like(rows[-1]))
    tallest = max(row.shape[0] for row in rows)
    rows = [np.pad(row, ((0, tallest - row.shape[0]), (0, 0), (0, 0))) for row in rows]
    rows = [np.hstack(rows[k : k + 2]) for k in range(0, len(rows), 2)]
    cv2.imwrite(str(sheet), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 40] if sheet.suffix == ".jpg" else [])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", nargs="?", type=Path, help="folder with data/ and street/")
    parser.add_argument("--sheet", type=Path, metavar="FOLDER")
    parser.add_argument("--only", nargs="*", default=[], help="parts of names of cases")
    parser.add_argument("-o", "--output", type=Path, required=True)
    args = parser.parse_args()
    if args.sheet:
        lay_out(args.sheet, args.output, args.only)
    elif args.shared:
        make(args.shared, args.output, args.only)
    else:
        parser.error("give the folder with data/ and street/, or --sheet")


if __name__ == "__main__":
    main()
