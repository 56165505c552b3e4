"""The way of one picture through the code: which file hands it to which, in `dlama.complete(rgbd, [camera])`, and how often.

    python benchmarks/walk.py [--against COMMIT] [--path]

A call counts that is handed a picture, a view or a scene, each function once, at its first call. Printed are the stays (a file,
and each time it is come back to), the files, the returns to a file, the climbs (from a room to one above it, in the order of
imports) and the changes of the name that the data has. --path prints the functions in their order. A commit is unpacked out of
`git archive` and walked by the same packages.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from itertools import groupby, pairwise
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, NamedTuple

from speed import ROOT, unpacked

ROOMS = ("arguments", "geometry", "models", "perception", "inpainters", "completion")
"""From the lowest on; a room imports those before it."""


class Stop(NamedTuple):
    """A function that is handed the data."""

    file: str
    function: str
    name: str
    """What it calls the data."""


def stops() -> Iterator[Stop]:
    """The functions that a view of the demo frame walks through, in the order of their first calls."""
    import dlama

    root = Path(dlama.__file__).parent
    rgbd = dlama.read_rgbd(root / "assets" / "demo" / "street.jpg", root / "assets" / "demo" / "depth.png", fov=90)
    camera, kinds = dlama.orbit(rgbd.camera, 20), (dlama.RGBD, dlama.View, dlama.Scene)
    first: dict[CodeType, str] = {}

    def note(frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if event != "call" or code in first or not code.co_filename.startswith(str(root)) or code.co_name[0] == "<":
            return
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        data = (one for one in names if one not in ("self", "cls") and isinstance(frame.f_locals.get(one), kinds))
        if name := next(data, ""):
            first[code] = name

    sys.setprofile(note)
    try:
        dlama.complete(rgbd, [camera])
    finally:
        sys.setprofile(None)
    for code, name in first.items():
        yield Stop(str(Path(code.co_filename).relative_to(root)), code.co_name, name)


def level(file: str) -> int:
    """How high a file's room lies; -1: none of ROOMS."""
    room = Path(file).parts[0].removesuffix(".py")
    return ROOMS.index(room) if room in ROOMS else -1


def measure(walked: list[Stop]) -> dict[str, int]:
    """Each figure by its name."""
    files = [file for file, _ in groupby(stop.file for stop in walked)]
    return {
        "functions": len(walked),
        "stays": len(files),
        "files": len(set(files)),
        "returns": len(files) - len(set(files)),
        "climbs": sum(level(before) < level(after) for before, after in pairwise(files)),
        "changes of name": sum(1 for _ in groupby(stop.name for stop in walked)) - 1,
    }


def walk_in(source: Path) -> list[Stop]:
    """The stops in a process that imports dlama from `source`."""
    line = [sys.executable, __file__, "--stops"]
    found = subprocess.run(
        line, env=os.environ | {"PYTHONPATH": str(source)}, capture_output=True, text=True, check=True
    )
    return [Stop(*each) for each in json.loads(found.stdout.splitlines()[-1])]


def main() -> None:
    """Print the figures, next to those of a commit where one is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", metavar="COMMIT", help="print the figures of this commit, too")
    parser.add_argument("--path", action="store_true", help="print each function that is handed the data")
    parser.add_argument("--stops", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.stops:
        warnings.simplefilter("ignore")
        print(json.dumps([*stops()]))
        return
    now = walk_in(ROOT / "src")
    before: dict[str, int] = {}
    if args.against:
        with unpacked(args.against) as old:
            before = measure(walk_in(old / "src"))
    for name, figure in measure(now).items():
        print(f"{name:20}" + (f"{before[name]:6}" if before else "") + f"{figure:6}")
    if args.path:
        print(*(f"{stop.file:48}{stop.function}({stop.name})" for stop in now), sep="\n")


if __name__ == "__main__":
    main()
