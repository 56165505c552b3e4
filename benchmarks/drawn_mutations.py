"""Lines that changed since a commit in; faults drawn at random in them, and which the tests that run those lines notice, out.

    printf '[run]\nsource = src/dlama\ndynamic_context = test_function\n' > /tmp/contexts
    python -m coverage run --rcfile=/tmp/contexts -m pytest -n 0 -m "not slow" --junit-xml=times.xml
    python benchmarks/drawn_mutations.py --since COMMIT --count 172 --times times.xml

Nobody chooses what is drawn: conditions are negated, operators and bounds exchanged, numbers changed, calls and errors left
out. Some change nothing that can be seen (a tolerance, the size of a cache); those are judged by hand. Each is put into a
scratch copy; the checkout itself is never changed. Needs `pip install coverage`.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import cv2  # noqa: F401  libraries that each forked process needs
import numba  # noqa: F401
import pytest
import torch  # noqa: F401
from coverage import CoverageData

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("src", "tests", "examples", "docs", "benchmarks", "conda", "pyproject.toml", "README.md", "CHANGELOG.md")
LIMIT = 900
"""Seconds that the tests of one fault may take."""
PASSED, FAILED = 0, 1
"""Exit codes of pytest; others mean that it tested nothing."""
PACKAGE = ROOT / "src" / "dlama"
NEGATED = {"Lt": ">=", "LtE": ">", "Gt": "<=", "GtE": "<", "Eq": "!=", "NotEq": "==", "In": "not in", "NotIn": "in"}
NEGATED |= {"Is": "is not", "IsNot": "is"}
EXCHANGED = {"Add": "-", "Sub": "+", "Mult": "/", "Div": "*", "BitAnd": "|", "BitOr": "&", "FloorDiv": "*", "Mod": "*"}
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any", "floor": "ceil", "ceil": "floor"}
NAMES |= {"minimum": "maximum", "maximum": "minimum", "argmin": "argmax", "argmax": "argmin"}
Fault = tuple[str, int, int, int, int, str]
"""File in src/dlama, first line and column, last line and column (1-based lines, columns in bytes), and what is put there."""


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


def changed_lines(since: str) -> dict[str, set[int]]:
    """File in src/dlama -> numbers of its lines that were added or changed."""
    words = ["git", "diff", "-U0", "--diff-filter=AMR", since, "--", "src/dlama"]
    found: dict[str, set[int]] = defaultdict(set)
    for line in (
        subprocess.run(words, cwd=ROOT, capture_output=True, check=True).stdout.decode("utf-8", "replace").splitlines()
    ):
        if line.startswith("+++ b/src/dlama/"):
            name = line[len("+++ b/src/dlama/") :]
        elif match := re.match(r"@@ -\S+ \+(\d+)(?:,(\d+))? @@", line):
            found[name].update(range(int(match[1]), int(match[1]) + int(match[2] or 1)))
    return {name: lines for name, lines in found.items() if name.endswith(".py")}


def faults_of(tree: ast.AST) -> Iterator[tuple[ast.AST, str]]:
    """Nodes and what may stand in their place; none of docstrings, annotations and messages."""
    skipped = set[ast.AST]()
    for node in ast.walk(tree):
        for name in ("annotation", "returns"):
            skipped.update(ast.walk(getattr(node, name)) if getattr(node, name, None) else ())
        for decorator in getattr(node, "decorator_list", ()):
            skipped.update(ast.walk(decorator))
        if isinstance(node, ast.JoinedStr | ast.Raise):
            skipped.update(child for child in ast.walk(node) if child is not node)
    for node in ast.walk(tree):
        if node in skipped or not hasattr(node, "lineno"):
            continue
        text = ast.unparse(node)
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            symbol = NEGATED[type(node.ops[0]).__name__]
            yield node, f"({ast.unparse(node.left)} {symbol} {ast.unparse(node.comparators[0])})"
        elif isinstance(node, ast.BinOp) and type(node.op).__name__ in EXCHANGED and "'" not in text:
            yield (
                node,
                f"(({ast.unparse(node.left)}) {EXCHANGED[type(node.op).__name__]} ({ast.unparse(node.right)}))",
            )
        elif isinstance(node, ast.BoolOp):
            word = " and " if isinstance(node.op, ast.Or) else " or "
            yield node, "(" + word.join(f"({ast.unparse(value)})" for value in node.values) + ")"
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.Invert | ast.USub):
            yield node, f"({ast.unparse(node.operand)})"
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
            yield node, str(not node.value)
        elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            yield node, repr(node.value + 1 if isinstance(node.value, int) else node.value * 2 or 1.0)
        elif isinstance(node, ast.Name) and node.id in NAMES:
            yield node, NAMES[node.id]
        elif isinstance(node, ast.Attribute) and node.attr in NAMES:
            yield node, f"({ast.unparse(node.value)}).{NAMES[node.attr]}"
        elif isinstance(node, ast.Raise) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)):
            yield node, "pass"
        elif isinstance(node, ast.IfExp):
            yield node, f"({ast.unparse(node.orelse)})"
        elif isinstance(node, ast.Call) and node.keywords and node.keywords[-1].arg:
            less = ast.Call(node.func, node.args, node.keywords[:-1])
            yield node, ast.unparse(less)


def draw(since: str, count: int, seed: int) -> list[Fault]:
    """That many, on as many different lines."""
    found = defaultdict(list)
    for name, lines in changed_lines(since).items():
        for node, text in faults_of(ast.parse((PACKAGE / name).read_text("utf-8"))):
            if node.lineno in lines:
                place = (name, node.lineno, node.col_offset, node.end_lineno, node.end_col_offset)
                found[name, node.lineno].append((*place, text))
    rng = random.Random(seed)
    places = rng.sample(sorted(found), min(count, len(found)))
    return [rng.choice(found[place]) for place in places]


def run_tests(folder: Path, named: list[str]) -> str:
    """caught, survived or broken: what these tests of a copy find, in a process forked from this one, which has all libraries."""
    child = os.fork()
    if child == 0:
        code = 70
        try:
            os.chdir(folder)
            null = os.open(os.devnull, os.O_RDWR)
            os.dup2(null, 1)
            os.dup2(null, 2)
            sys.dont_write_bytecode = True
            sys.path[:0] = [str(folder / "src"), str(folder / "tests")]
            os.environ["PYTHONPATH"] = str(folder / "src")
            signal.alarm(LIMIT // 3)
            code = int(pytest.main(["-q", "-x", "-n", "0", "-p", "no:cacheprovider", *named]))
        finally:
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return {PASSED: "survived", FAILED: "caught", -signal.SIGALRM: "caught"}.get(code, "broken")


def put(path: Path, fault: Fault) -> str:
    """Write it into a copy of its file; the line as it was."""
    _, line, column, last, end, text = fault
    lines = path.read_bytes().splitlines(keepends=True)
    before = b"".join(lines[: line - 1]) + lines[line - 1][:column]
    after = lines[last - 1][end:] + b"".join(lines[last:])
    path.write_bytes(before + text.encode() + after)
    return b"".join(lines[line - 1 : last]).decode().strip()


class Reached:
    """Which tests run a line, quickest first."""

    def __init__(self, coverage: Path, times: Path) -> None:
        self.data = CoverageData(str(coverage))
        self.data.read()
        self.seconds: dict[str, float] = defaultdict(float)
        self.names: dict[str, str] = {}
        for case in ElementTree.parse(times).iter("testcase"):
            file, name = case.attrib["classname"].replace(".", "/") + ".py", case.attrib["name"].partition("[")[0]
            context = f"{Path(file).stem}.{name}"
            self.names[context] = f"{file}::{name}"
            self.seconds[context] += float(case.attrib["time"])

    def tests(self, name: str, lines: range | None, seconds: float) -> list[str]:
        """As many of those that run these lines (None: any of the file) as that time is enough for, the file's own first."""
        found = self._contexts(PACKAGE / name, lines)
        if not found:  # compiled, or run by other processes alone: those that run what imports it
            module = "dlama." + name[:-3].replace("/", ".")
            imports = f"from {module} import", f"from {module.rpartition('.')[0]} import {Path(name).stem}"
            for path in PACKAGE.rglob("*.py"):
                if any(line in path.read_text("utf-8") for line in imports):
                    found |= self._contexts(path, None)
        own = f"test_{Path(name).stem}."
        chosen, total = list[str](), 0.0
        for one in sorted(found & set(self.names), key=lambda one: (not one.startswith(own), self.seconds[one])):
            total += self.seconds[one]
            if total > seconds and chosen:
                break
            chosen.append(self.names[one])
        return chosen

    def _contexts(self, path: Path, lines: range | None) -> set[str]:
        by_line = self.data.contexts_by_lineno(str(path))
        return {one for line, each in by_line.items() if lines is None or line in lines for one in each if one}


def main() -> None:
    """Print a line for each fault and the total."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--since", required=True, help="a commit")
    parser.add_argument("--count", type=int, default=172)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--coverage", type=Path, default=ROOT / ".coverage")
    parser.add_argument("--times", type=Path, required=True, help="JUnit XML of the same run")
    parser.add_argument("--seconds", type=float, default=10.0, help="of tests for a fault")
    parser.add_argument("--only", type=int, nargs="*", help="numbers of faults, of those drawn")
    given = parser.parse_args()
    reached, counts = Reached(given.coverage, given.times), Counter[str]()
    with scratch_copy(ROOT / "tests", kernels=False) as common:
        for number, fault in enumerate(draw(given.since, given.count, given.seed)):
            if given.only is not None and number not in given.only:
                continue
            name, line, _, last, _, text = fault
            started, kernels = time.monotonic(), "/kernels" in name
            with scratch_copy(ROOT / "tests", kernels) if kernels else nullcontext(common) as folder:
                target, named, found = folder / "src" / "dlama" / name, list[str](), "survived"
                original, stamps = target.read_bytes(), target.stat()
                was = put(target, fault)
                for lines, seconds in ((range(line, last + 1), given.seconds), (None, 3 * given.seconds)):
                    if found == "survived":
                        more = [one for one in reached.tests(name, lines, seconds) if one not in named]
                        found, named = run_tests(folder, more) if more else found, named + more
                target.write_bytes(original)
                os.utime(
                    target, ns=(stamps.st_atime_ns, stamps.st_mtime_ns)
                )  # so that compiled kernels are still its own
            counts[found] += 1
            print(
                f"{found:9}{number:4} {name}:{line} {was!r} -> {text!r} ({len(named)} tests, {time.monotonic() - started:.0f} s)",
                flush=True,
            )
    print(", ".join(f"{counts[word]} {word}" for word in ("caught", "survived", "broken")), f"of {counts.total()}")


if __name__ == "__main__":
    main()
