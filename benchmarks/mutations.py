"""Faults in; each is put into a scratch copy of the package, and which of them the tests named for it catch comes out.

    python benchmarks/mutations.py                      # all of benchmarks/mutants.py, room by room
    python benchmarks/mutations.py geometry nets        # of these rooms only
    python benchmarks/mutations.py --tests ../old/tests # by the tests of another checkout, to compare

A fault is an exact text and what stands there instead. What a run says of each:

caught    a named test failed, or ran into the time limit
survived  all named tests passed: a gap
broken    nothing was tested: the package could not be imported, or no such test exists
gone      the text does not stand there (exactly once) any more: the fault wants to be written anew

No part of continuous integration. The checkout itself is never changed.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mutants import MUTANTS, Mutant

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("src", "tests", "examples", "docs", "benchmarks", "conda", "pyproject.toml", "README.md", "CHANGELOG.md")
LIMIT = 900
"""Seconds that the tests of one fault may take."""
PASSED, FAILED = 0, 1
"""Exit codes of pytest; others mean that it tested nothing."""


@contextmanager
def scratch_copy(tests: Path, kernels: bool) -> Iterator[Path]:
    """A copy of the checkout with those tests. kernels: without compiled ones, which would be taken for those of the fault."""
    with tempfile.TemporaryDirectory(prefix="dlama-mutant-") as name:
        folder = Path(name)
        for part in COPIED:
            place = tests if part == "tests" else ROOT / part
            if place.is_dir():
                ignored = shutil.ignore_patterns("*.nbi", "*.nbc") if kernels else None
                shutil.copytree(place, folder / part, ignore=ignored)
            elif place.is_file():
                shutil.copy2(place, folder / part)
        yield folder


def verdict(mutant: Mutant, tests: Path) -> str:
    """caught, survived, broken or gone."""
    with scratch_copy(tests, "/kernels/" in mutant.file) as folder:
        target = folder / "src" / "dlama" / mutant.file
        text = target.read_text("utf-8") if target.is_file() else ""
        if text.count(mutant.old) != 1:
            return "gone"
        target.write_text(text.replace(mutant.old, mutant.new), "utf-8")
        named = mutant.tests.split()
        if tests != ROOT / "tests":  # another checkout has not the same tests in its files
            named = [
                name for name in dict.fromkeys(one.partition("::")[0] for one in named) if (folder / name).is_file()
            ]
        if not named:
            return "survived"
        words = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *named]
        environment = {**os.environ, "PYTHONPATH": str(folder / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
        try:
            done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, timeout=LIMIT, check=False)
        except subprocess.TimeoutExpired:
            return "caught"
    return {PASSED: "survived", FAILED: "caught"}.get(done.returncode, "broken")


def main() -> None:
    """Print a line for each fault and the total; exit with 1 unless all were caught."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("words", nargs="*", help="rooms, or parts of a fault's name; none: all")
    parser.add_argument("--tests", type=Path, default=ROOT / "tests", help="folder the tests are taken from")
    chosen = parser.parse_args()
    told = []
    for mutant in MUTANTS:
        if not chosen.words or any(word in f"{mutant.room} {mutant.name}" for word in chosen.words):
            started = time.monotonic()
            told.append(verdict(mutant, chosen.tests.resolve()))
            seconds = time.monotonic() - started
            print(f"{told[-1]:9}{mutant.room:12}{mutant.name} ({mutant.file}, {seconds:.0f} s)", flush=True)
    counts = Counter(told)
    print(", ".join(f"{counts[word]} {word}" for word in ("caught", "survived", "broken", "gone")), f"of {len(told)}")
    if counts["caught"] < len(told):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
